"""The names of transformers that Marey uses, for type checkers: the package itself shows them all of its models.

A name that is missing here is an error of `make lint`: add it.
"""

from transformers.models.auto.tokenization_auto import AutoTokenizer as AutoTokenizer
from transformers.models.bert.configuration_bert import BertConfig as BertConfig
from transformers.models.bert.modeling_bert import BertModel as BertModel
from transformers.models.clip.modeling_clip import CLIPTextModelWithProjection as CLIPTextModelWithProjection
from transformers.models.clip.tokenization_clip import CLIPTokenizer as CLIPTokenizer
from transformers.models.distilbert.modeling_distilbert import DistilBertModel as DistilBertModel
from transformers.models.t5.modeling_t5 import T5EncoderModel as T5EncoderModel
