"""Words of which models read another action than is asked for, replaced before a prompt is read (ours)."""

from __future__ import annotations

import re
from collections.abc import Mapping

from marey.text.action_reader import named_actions
from marey.text.blows_met import with_blows_met
from marey.text.dropped_seats import with_seats_taken
from marey.text.lost_footing import with_falls
from marey.text.misleading_ways import with_exits, with_stairs_down, with_turns_between, with_ways_ahead
from marey.text.named_blows import with_blows_named
from marey.text.punched_air import with_pumped_fists
from marey.text.turned_ways import with_turns_told
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.inflection import in_form_of, indefinite_article
from marey.vocabulary.scope import STANDING

_STRUCK = re.compile(
    r"""\b(?P<is>is|are|gets?|got|getting|being)[ ](?P<how>\w+ly\ )?
    (?:stabbed|kicked|slashed|slapped|pushed|shoved|bitten|tackled|clubbed|headbutted|elbowed|kneed|whipped|smacked
    |speared|rammed|shot(?!\ (?:at|down|dead|to|out)\b))\b
    (?!\ (?:away|off|around|along|through|to|by\ (?:a|the)\ (?:man|woman|person|worker))\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A blow that the person takes: "is pushed from behind"."""
_SHOT = re.compile(r"(?:^|(?<=[,;:-] ))shot(?= (?:in|from|through) (?:behind|the|his|her|its|their)\b)", re.IGNORECASE)
"""The same without a verb: "shot in the chest, staggers back"."""
_HIT_LIMB = re.compile(
    r"\b(?P<hit>gets?|getting|is|are|being)(?P<how> (?:\w+ly )?hit) (?:in|on|to) (?:the|his|her|their|its) "
    r"(?:left |right |upper |lower )?(?:leg|thigh|knee|shin|foot|ankle|calf|arm|forearm|elbow|wrist|hand)\b",
    re.IGNORECASE,
)
"""A blow to a limb, of which models read a kick, or an arm that blocks."""
_SHOT_DEAD = re.compile(r"\b(?P<is>is|are|gets?|got|being) shot (?:dead|down)\b", re.IGNORECASE)
"""A blow that kills."""
_STRUCK_DOWN = re.compile(
    r"""\b(?:is|are|gets?|got)[ ](?:\w+ly[ ])?
    (?:shot|hit|struck|stabbed|punched|kicked|slashed|pushed|shoved|tackled|clubbed|wounded|headbutted)\b
    [^,.;]{0,40}?(?:,[ ](?:and[ ])?(?:then[ ])?|[ ]and[ ](?:then[ ])?)
    (?=(?:slowly[ ]|suddenly[ ]|instantly[ ])?(?:falls?|dies?|collapses?|drops?[ ](?:dead|to[ ]the|down)
    |crumples?|topples?|keels?|goes?[ ]down|slumps?)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A blow before a fall, which is part of it."""
_STRIKES_BACK = re.compile(r"\bcounter(?:[ -]?(?:attack|strik)(?:e?s|e|ing)?)\b", re.IGNORECASE)
_BLADE = re.compile(r"\b(?:sword|blade|katana|sabre|saber|dagger|knife|axe|shield|parr(?:y|ies|ying))\b", re.IGNORECASE)
_TURNS_IN_AIR = re.compile(
    r"""\b(?P<jump>jumps?|jumping|leaps?|leaping|hops?)(?:\ (?:up|into\ the\ air|straight\ up))?
    (?:\ (?P<degrees>\d{2,3})(?:\ degrees?|°)
    |(?:,|\ and|,\ and)?\ land(?:s|ing)?\ facing\ (?:the\ (?:other|opposite)\ (?:way|direction)|backwards?))""",
    re.IGNORECASE | re.VERBOSE,
)
"""Jumps with a turn: "jumps 360 degrees", "jumps and lands facing the other way"."""
_AT_WHEEL = re.compile(
    r"""(?P<drives>\b(?:drives?|driving|steers?|steering)\b[^,.;]*?)
    (?:,|,?\ (?:with|keeping|holding|and\ (?:keeps|holds)))?(?:\ with)?
    \ (?:his\ |her\ |their\ |both\ |two\ |the\ )*hands?\ (?:firmly\ |tightly\ )?(?:on|at|gripping|holding|upon)
    \ (?:the|his|her|their)\ (?:steering\ )?wheel""",
    re.IGNORECASE | re.VERBOSE,
)
"""The hands of who drives, which are where they are anyway."""
_ACTS_THEMSELVES = (
    "guard|sentry|boxer|archer|climber|drinker|swimmer|dancer|ballerina|jogger|runner|walker|pilot|driver|referee"
    "|goalkeeper|goalie|kicker|puncher|fighter|wrestler|fencer|crawler|shooter|golfer|skater|skier|diver|kickboxer"
    r"|(?:kung[ ]?fu|karate|judo|taekwondo|tae[ ]kwon[ ]do|martial[ ]arts?|tai[ ]chi)[ ]\w+"
)
_DOER = re.compile(
    rf"""^(?P<who>\W*(?:(?:a|an|the|this|that|one|another)\ )?
    (?:(?!(?:a|an|the|my|your|his|her|just|do|keep|point)\ )[\w-]+\ )??)
    (?P<doer>{_ACTS_THEMSELVES})
    (?P<does>(?:\ (?:(?:who|that)\ )?is)?(?:\ \w+ly)?\ (?P<verb>[a-z'-]+)\b[^,;]*)$""",
    re.IGNORECASE | re.VERBOSE,
)
"""The subject of one movement whose noun is that of an action: "the guard waits", "a boxer stands up"."""
_POINTS_TO = re.compile(
    r"""\b(?P<points>point(?:s|ing)?)\ (?:over\ )?to(?=\ (?:the|a|an|his|her|their|its|some\w*|him|her|them|me|you)\b)
    (?!\ (?:the|his|her|their|its)\ (?:left|right|side|sky|ceiling|ground|floor|head|chest|eyes?|face|self))""",
    re.IGNORECASE | re.VERBOSE,
)
"""A thing that is pointed at."""
_DOES = ("does", "executes", "throws", "delivers", "lands")
"""Verbs of which the object alone says what is done."""
_PREPARED = re.compile(r"\b(?:stance|fists?|guard|ready|bounc\w+|shadow)\b", re.IGNORECASE)
"""Words of who stands as the noun says: "a boxer stands ready"."""
_JOINED = re.compile(r"\b(?:and(?! (?:forth|fro|right|left))|then|before|until|after)\b", re.IGNORECASE)
_AN = re.compile(r"\ban (?=$)", re.IGNORECASE)
_BACK_TO_WALL = re.compile(
    r"""\b(?:(?:press|lean|flatten|push|put|rest|brac)(?P<s>e?s)?|(?P<ing>press|lean|flatten|push|putt|rest|brac)ing)
    (?:\ (?:his|her|their|its)\ back|\ (?:him|her|them|it)sel\w+|\ back(?=\ (?:against|to)))
    (?:\ (?:flat|firmly|hard|up|tight\w*))*\ (?P<where>(?:against|to|on|onto|at)\ (?:a|an|the|his|her)\ (?:\w+\ )?
    (?:wall|pillar|column|door|fence|tree|rock|cover|corner))\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body at rest against something, of which models read a push."""
_STUMBLES_BACK = re.compile(
    r"\b(?P<verb>(?:stumbl|stagger|reel|totter|lurch|wobbl)(?:es?|s|ing|ed)?)(?P<how> \w+ly)? back"
    r"(?!wards?\b| and forth\b| (?:to|into|onto|in|home|up|on)\b)",
    re.IGNORECASE,
)
"""A step that catches a body which loses its balance: "stumbles back"."""
_HIT_AND_STUMBLES = re.compile(
    r"""(?P<hit>\b(?:gets?|got|is|takes?|receives?|being|getting)\ (?:\w+ly\ )?(?:an?\ )?
    (?:(?:hard|heavy|strong|big)\ )?
    (?:hit|struck|punched|kicked|slapped|shoved|pushed|blow|punch|shot)\b[^,.;]{0,40}?)
    (?:,|,?\ and|,?\ then|,?\ and\ then)\ (?:(?:he|she)\ )?(?:stumbl|stagger|reel)(?:es|s|ing)?\ (?:\w+ly\ )?
    (?:a\ (?:bit|little|step)\ )?back(?:wards?)?(?=$|[.,;]|\ (?:and|then)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A blow and the step back that it takes, which are one movement."""
_ON_FLOOR = re.compile(
    r"""\b(?P<sits>sit|sits|sitting|sat)(?:\ down)?(?P<how>\ \w+ly)?
    (?P<legs>\ (?:cross(?:ed)?[ -]legged|in\ (?:a\ |the\ )?lotus(?:\ (?:pose|position))?
    |with\ (?:(?:his|her|their)\ )?(?:legs\ crossed|crossed\ legs)))(?!\ (?:on|in|at|upon)\ )""",
    re.IGNORECASE | re.VERBOSE,
)
"""A seat on the floor that does not say so: "sits down cross-legged"."""
_LAYS_LEG = re.compile(
    r"""(?P<sits>\b(?:sits?|sitting|sat|(?:takes?|taking)\ a\ seat|seated)\b
    (?:(?!\b(?:floor|ground|and|then)\b)[^.;,])*?)
    (?:,?\ and\ then|,?\ and|,?\ then|,|\ to)\ (?:(?:he|she)\ )?cross(?:es|ing)?\ (?:(?:his|her|their)\ legs
    |one\ leg\ over\ (?:the\ )?other)\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""A leg that is laid over the other on a seat, which is one movement with the way there."""
_SEAT = re.compile(
    r"\b(?:floor|ground|grass|mat|carpet|rug|sand|bed|chair|bench|sofa|couch|seat|stool|throne|table|cushion|pillow)\b",
    re.IGNORECASE,
)
_SIDEWAYS = re.compile(
    r"""\b(?P<way>(?:sneak|creep|prowl|tip-?toe|crouch(?:ed|ing)?[ -]?walk)(?:s|ing|ed)?)
    (?:\ (?:walk|strafe|strafing|walking|move|step|run)s?)?(?P<how>\ \w+ly)?
    (?=\ (?:to\ (?:the|his|her|their)\ )?(?:left|right|side)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A crouched way to a side, of which models read one ahead."""
_TO_BOTH_SIDES = re.compile(
    r"""(?P<work>\b(?:mop|sweep|scrub|wip|rak|polish|vacuum|hoover|saw|brush|clean|wash|rub|paint|dust|sand|plan|buff|comb
    |scrap|iron|grat|whisk|stir)(?:p?e?s|p?ing|e)?\b[^,.;]*?)
    \ (?:from\ (?:one\ )?side\ to\ (?:the\ other|(?:the\ )?side)|side\ to\ side|back\ and\ forth|to\ and\ fro
    |(?:from\ )?left\ (?:to|and)\ right
    |(?:from\ )?right\ (?:to|and)\ left)(?=$|[,.;!]|\ (?:and|then|with|while|as)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""Strokes of work, of which models read steps to the sides: "mops the floor from side to side"."""
_SPINS_AROUND = re.compile(
    r"\b(?P<spins>(?:spin|twirl|whirl)(?:s|n?ing)?) (?:a)?round "
    r"(?=(?:exactly |just |only )?(?:once|twice|thrice|[\w-]+ times)\b)",
    re.IGNORECASE,
)
"""A number of spins, of which models read one turn to face back."""
_COVERS_HEAD = re.compile(
    r"""(?P<low>\b(?:crouch|duck|squat|hunch|huddl)\w*(?:\ down)?(?:\ low)?)(?:,|\ and|,\ and|\ while|,\ while)?
    \ (?:with\ )?
    (?:(?:cover|shield|protect)(?:s|ing)?\ (?:his|her|their)\ head
    (?:\ with\ (?:(?:both|his|her|their)\ )*(?:arms|hands))?
    |(?:(?:both|the|his|her|their)\ )*(?:arms|hands)\ (?:(?:held|raised|up)\ )?
    (?:over|above|around|on|covering)\ (?:(?:the|his|her|their)\ )?head)
    (?=$|[,.;!]|\ (?:and|then|while|as)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""The head that who crouches covers, of which models read a guard or a raised arm."""
_SHIFTS = re.compile(
    r"""\b(?P<shifts>shift(?:s|ing|ed)?(?:[ ](?:his|her|their|its|the))?[ ](?:body[ ]?)?weight)(?:[ ](?:a[ ])?\w+)??
    [ ](?:from[ ](?:(?:one|the|his|her|their)[ ])?(?:(?:left|right)[ ])?(?:leg|foot|side|hip)
    [ ]to[ ](?:(?:the|his|her|their)[ ])?(?:other|leg|foot|side|hip|left|right)(?:[ ](?:leg|foot|one|side|hip))?
    |between[ ](?:(?:the|his|her|their|both|two)[ ]){0,2}(?:legs|feet))""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body at rest whose weight goes to and fro between its feet, of which models read a balance on one leg."""
_HURDLE = re.compile(
    r"""\b(?P<thing>hurdle|fence|obstacle|barrier|puddle|gap|ditch|box|log|wall)(?:[ ]|-)
    (?P<jump>jump(?:s|ing)?|leap(?:s|ing)?)\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""A jump that is named by what it clears: "hurdle jump"."""
_CLEARS = re.compile(
    r"""\b(?P<jump>(?:jump|leap|hop|hopp)(?:s|ing)?)(?=\ (?:an?|the|his|her|some|two|three)\ (?:[\w-]+\ )?
    (?:fence|wall|hurdle|gate|ditch|puddle|stream|brook|creek|gap|barrier|log|obstacle|hedge|railing|chasm|trench|pit)s?\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A jump of which the object is what it clears: "jumps the fence"."""
_ROLLS_OVER = re.compile(
    r"""(?<!barrel[ ])(?<!forward[ ])(?<!shoulder[ ])(?<!log[ ])
    \b(?:(?P<s>rolls|turns)|(?P<ing>rolling|turning)|roll|turn)(?:[ ]\w+ly)?(?:[ ](?:over|back|around))?
    (?:[ ]\w+ly)?[ ](?:(?:on|onto|on[ ]to|to)[ ](?P<where>(?:his|her|their|its|the|one)[ ](?:(?:left|right|other)[ ])?
    (?:back|stomach|belly|side|front|face))|(?=in[ ](?:(?:his|her|their|the|a)[ ])?(?:bed|sleep)))\b
    (?![ ]of\b)(?![ ](?:to|and)[ ](?:his|her|their|its|the)[ ](?:feet|knees))""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that lies and turns over, of which models read a dive roll; "turns to the side" is said of others."""
_ROLLS_FROM_THERE = re.compile(
    r"""(?P<lies>\b(?:l(?:ies|ie|ying|ay)|asleep|sleeps?|sleeping|prone|supine|in\ bed)\b[^.;]*?)
    \b(?P<rolls>roll(?:s|ing)?)(?P<how>\ \w+ly)?\ over(?=$|[,.;!]|\ (?:and|then|slowly|once|again)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that lies and turns over, where the words do not say onto what: "lies on his back and rolls over"."""
_ON_FRONT = re.compile(r"\b(?:stomach|belly|front|face[ -]?down|prone)\b", re.IGNORECASE)
_LAY = re.compile(
    r"\bl(?:ies|ie|ying|ay)\b(?! down)|\b(?:asleep|sleep\w*|crawl\w*|face[ -]?(?:up|down))\b", re.IGNORECASE
)
"""Words of a body that is down already."""
_LYING = re.compile(r"\b(?:l(?:ies|ie|ying|ay)|asleep|sleep\w*|bed|prone|supine|floor|ground|over)\b", re.IGNORECASE)
_OVER_KNEES = re.compile(
    r"""\b(?:falls?|drops?|sinks?|collapses?|goes|crumples?|slumps?)(?:[ ]\w+ly)?(?:[ ]down)?[ ](?:to|on|onto)
    [ ](?:(?:his|her|their|its|the|both)[ ])?knees?(?:,?[ ]and[ ]then|,?[ ]then|,?[ ]and|,|[ ]before)
    [ ](?:(?:he|she)[ ])?(?:\w+ly[ ])?
    (?:falls?|falling|collaps(?:es?|ing)|toppl(?:es?|ing)|slump(?:s|ing)?|keel(?:s|ing)?|drops?|dropping|pitch(?:es|ing)?
    |di(?:es?)|dying|fall)\b(?![ ]asleep|[ ](?:to|on|onto)[ ](?:his|her|their|its|the)[ ](?:hands|elbows))
    (?P<how>(?:[ ](?:over|down|dead|face[ -]?(?:first|down)|lifeless|onto|on|to|the|his|her|floor|ground|face|side|front
    |stomach|chest))*)(?P<way>[ ](?:forwards?|sideways|backwards?))?(?P<dead>[ ]dead)?""",
    re.IGNORECASE | re.VERBOSE,
)
"""A fall over the knees, which is one movement."""
_TO_KNEES = re.compile(
    r"""\b(?P<fast>fall|drop|collaps|crumple|slump|crash|tumbl)?(?(fast)|(?:sink|go|get|come))(?P<end>e?s|e?d|ing|e)?
    (?P<how>[ ]\w+ly)?(?:[ ](?:down|heavily|hard))?[ ](?:to|on|onto)
    [ ](?:both[ ](?:of[ ])?)?(?:(?:his|her|their|its)[ ])?(?:two[ ])?knees\b(?![ ](?:and|or)[ ](?:hands|elbows))""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that comes down onto its knees and stays there, of which models read a death, or one knee."""
_KNEE = re.compile(
    r"(?P<joint>^|[,;+&]\s*|\b(?:and|then)\s+)(?:(?P<before>left|right) knee|knee (?P<side>left|right))"
    r"(?: strike)?(?=$|[.,;+&]| (?:and|then)\b)",
    re.IGNORECASE,
)
_BLOWS = re.compile(r"\b(?:punch|jab|hook|cross|uppercut|elbow|kick|strike)(?:e?s)?\b", re.IGNORECASE)
"""A blow with the knee in a list of blows, of which models read who kneels."""
_ROPE = r"""(?:(?:a|an|the|his|her|their)\ )?(?:(?!to\b|stairs|steps)[\w-]+\ ){0,2}?
    (?:ropes?|vines?|chains?|poles?|drain\W?pipes?|pipes?|masts?|lianas?|bed\W?sheets)\b"""
_UP_ROPE = re.compile(
    rf"""\b(?:(?:pull|haul|heav|hoist|drag|lower)(?P<end>e?s|e|ed|ing)?\ (?:him|her|them|it)sel\w+
    |(?:shimm|shinn|inch|work|mak|go|swarm|scrambl|scurr)(?P<ends>ies|y|ied|ying|e?s|e|ed|ing)?
    (?:\ (?:his|her|their|its)\ way)?)
    (?P<how>(?:\ (?:\w+ly|hand\ over\ hand))*)(?=\ (?:(?:all\ the\ way|right|back)\ )?(?:up|down)\ {_ROPE})""",
    re.IGNORECASE | re.VERBOSE,
)
"""A climb of a rope, of which models read pull-ups and other ways: "hauls himself up the rope"."""
_HAND_OVER_HAND = re.compile(rf"^(?=\W*hand\ over\ hand,?\ (?:up|down)\ {_ROPE})", re.IGNORECASE | re.VERBOSE)
_DANCER_LEAPS = re.compile(
    r"""\b(?P<who>(?:ballerina|ballerino|dancer|gymnast)s?(?:\ is)?)\ leap(?P<end>s|ing)?\b
    (?:,?\ with\ (?:(?:his|her|their)\ )?arms\ (?:out\w*|spread|wide|open|extended)(?:\ to\ the\ sides?)?)?
    (?!\ (?:up|out|aside|back\w*|off|on|onto|into|to|down|for|with\ joy)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A leap of a dancer from one foot to the other, of which models read a jump or a dance."""
_THING = r"(?:a|an|the|his|her|their|its|some|my|your)"
OTHER_SENSE: Mapping[str, re.Pattern[str]] = {
    "roll": re.compile(
        rf"\broll(?:s|ed|ing)? (?:(?:up|out|back) )?(?:{_THING}|out|dough|dice|sleeves)\b", re.IGNORECASE
    ),
    "flip": re.compile(
        rf"\bflip(?:s|ped|ping)? (?:(?:up|open|over|off) )?(?:{_THING}|through)\b(?! (?:fence|wall|back|front))",
        re.IGNORECASE,
    ),
    "die": re.compile(
        rf"""\b(?:almost|nearly)\ (?:falls?|trips?|dies?|slips?|collapses?)\b
        |\bfall(?:s|ing)?\ (?:asleep|silent|in\ love|behind|for)\b|\bdies\ of\ (?:laughter|laughing|shame|boredom)\b
        |\b(?:falls?|collapses?|drops?|slumps?)\ (?:down\ |back\ )?(?:in|into|on|onto)[ ]
        (?:{_THING}\ )?(?:\w+\ )?(?:chair|seat|sofa|couch|armchair|bench|throne)\b""",
        re.IGNORECASE | re.VERBOSE,
    ),
    "lie": re.compile(r"\blie?(?:s|d|ying)? (?:about|to (?:a|an|his|her|the|them|him|me|you))\b", re.IGNORECASE),
    "lie-down": re.compile(r"\blie?(?:s|d|ying)? about\b", re.IGNORECASE),
}
"""Words of other actions than that which prompts with them are read as: "rolls up his sleeves", "almost falls"."""


_LUNGES = re.compile(
    r"""\A(?!.*\b(?:swords?|blades?|rapiers?|sabres?|sabers?|foil|[ée]p[ée]e|spears?|lances?|kni(?:fe|ves)|daggers?|pikes?
    |staff|stick|bayonets?|polearm|katana|weapons?|fenc\w*|duel\w*|stab\w*|thrust\w*|attack\w*|strik\w*|enem\w+
    |opponent|foe|parr\w+|atk|punch\w*|knights?|swords\w+|samurai|warriors?
    |gladiators?|spearm[ae]n|assassins?|musketeers?|soldiers?)\b)
    (?!.*\blung\w+[ ](?:\w+ly[ ])?(?:forwards?|ahead|at|towards?|for|out|in)\b)
    .*\blung(?:es?|ing|ed)\b""",
    re.IGNORECASE | re.VERBOSE | re.DOTALL,
)
EXERCISE = "squat"
"""Action of the knees that bend and stretch, as they do in a lunge."""


def lunges_as_exercise(prompt: str) -> bool:
    """Return True if a prompt has a body lunge, and names neither a weapon nor whom it attacks."""
    return _LUNGES.match(prompt) is not None


def has_other_sense(action: str | None, prompt: str) -> bool:
    """Return True if a prompt that is read as an action says one of its words in another sense."""
    words = None if action is None else OTHER_SENSE.get(action)
    return words is not None and words.search(prompt) is not None


def without_misleading(prompt: str) -> str:
    """Return a prompt without words of which models read another action.

    Who "walks up to the door" goes there, and who "walks down the street" goes along it: of "up" and "down" models read
    a climb. Who "walks back to his car" or "turns around and walks back" walks ahead, who "paces back and forth" turns
    on the way, and who "is kicked" is hit. Where the hands of a driver are is said of the wheel, and read as rising
    from the seat. The blow of who "is shot and falls" is part of the fall. A counterattack is a blow of the weapon.
    A guard that does something else than to guard is a person. Who lies and rolls over lies, whose weight shifts from
    leg to leg stands, who falls over the knees falls once, and who falls to the knees kneels. A leg is laid over the
    other as the body sits.
    Who meets a blow gets hit or dodges (`with_blows_met`), and turns are told as such (`with_turns_told`).
    Who goes up the stairs and "back down" turns around at their end, and who hauls himself up a rope climbs it. A
    dancer who leaps does so from one foot to the other.
    """
    prompt = with_turns_told(with_blows_named(with_blows_met(prompt)))
    prompt = with_stairs_down(prompt)
    prompt = _DANCER_LEAPS.sub(_performs_a_leap, with_falls(with_seats_taken(prompt)))
    prompt = _DOER.sub(_as_person, _AT_WHEEL.sub(r"\g<drives>", prompt))
    prompt = _LAYS_LEG.sub(r"\g<sits> with one leg over the other", prompt)
    prompt = _ON_FLOOR.sub(_on_floor, _BACK_TO_WALL.sub(_against, prompt))
    prompt = _COVERS_HEAD.sub(r"\g<low>", prompt)
    prompt = _SPINS_AROUND.sub(r"\g<spins> ", _TO_BOTH_SIDES.sub(r"\g<work>", prompt))
    prompt = _SIDEWAYS.sub(r"\g<way>\g<how> sideways", prompt)
    prompt = _HAND_OVER_HAND.sub("climbing ", _UP_ROPE.sub(_climbs, prompt))
    text = with_ways_ahead(_POINTS_TO.sub(r"\g<points> at", prompt))
    text = _STRIKES_BACK.sub(_strikes_back, _TURNS_IN_AIR.sub(_with_turn, text))
    text = _TO_KNEES.sub(_kneels, _OVER_KNEES.sub(_falls_over_knees, text))
    text = with_exits(with_pumped_fists(text))
    text = _STRUCK_DOWN.sub("", with_turns_between(text))
    text = _STRUCK.sub(_hit, _SHOT_DEAD.sub(r"\g<is> killed", text))
    text = _HIT_AND_STUMBLES.sub(r"\g<hit> hard", _SHOT.sub("gets hit", text))
    text = _ROLLS_FROM_THERE.sub(_rolls_onto, text)
    text = _ROLLS_OVER.sub(_lies, text)
    text = _CLEARS.sub(r"\g<jump> over", text)
    text = _SHIFTS.sub(r"\g<shifts>", _HURDLE.sub(_jumps_over, _KNEE.sub(_knee_strike, text)))
    return _HIT_LIMB.sub(r"\g<hit>\g<how>", _STUMBLES_BACK.sub(r"\g<verb>\g<how> backward", text))


def _as_person(found: re.Match[str]) -> str:
    """Return a prompt of one movement whose subject is a person, if its other words name an action, and ask for the
    same bearings of anybody; else as it is."""
    does, verb = found["does"], found["verb"].lower()
    named = named_actions(f"a person{does}")
    acts = verb in (STANDING, *_DOES) or named_actions(f"a person {verb}")
    if not named or _JOINED.search(does) or not acts:
        return found[0]
    if lunges_as_exercise(does) and not lunges_as_exercise(found[0]):
        return found[0]
    if {each.name for each in stated_bearings(found[0])} != {each.name for each in stated_bearings(f"a person{does}")}:
        return found[0]
    if named & named_actions(found["doer"]) or (named == {STANDING} and _PREPARED.search(does)):
        return found[0]
    return f"{_AN.sub('a ', found['who'] or 'a ')}person{does}"


def _against(found: re.Match[str]) -> str:
    """Return a body that stands with its back to something."""
    stands = "standing" if found["ing"] else "stands" if found["s"] else "stand"
    return f"{stands} with the back {found['where']}"


def _performs_a_leap(found: re.Match[str]) -> str:
    """Return who leaps with words that no jump has."""
    end = found["end"] or ""
    return f"{found['who']} perform{end} a leap"


def _climbs(found: re.Match[str]) -> str:
    """Return a climb in the form of the verb that is found."""
    return f"{in_form_of(found['end'] or found['ends'] or '', 'climb')}{found['how']}"


def _on_floor(found: re.Match[str]) -> str:
    """Return a seat on the floor, unless the prompt names another one."""
    if _SEAT.search(found.string):
        return found[0]
    return f"{found['sits']} down{found['how'] or ''} on the floor{found['legs']}"


def _with_turn(found: re.Match[str]) -> str:
    """Return a jump with the turn that it makes."""
    jump = found["jump"]
    return f"{jump} and {in_form_of(jump, 'turn')} {found['degrees'] or 180} degrees in the air"


def _strikes_back(found: re.Match[str]) -> str:
    """Return a counterattack as a blow of the weapon that its prompt names."""
    if _BLADE.search(found.string):
        said = "" if found.string[found.end() :].startswith(" with ") else " with the sword"
        return f"{in_form_of(found[0], 'slash')}{said}"
    return f"{in_form_of(found[0], 'throw')} a punch"


def _lies(found: re.Match[str]) -> str:
    """Return a body that lies on another side; one that lay before comes to it, as a movement of its own."""
    if found[0].lower().startswith("turn") and not _LYING.search(found.string):
        return found[0]
    lies = in_form_of(found["ing"] or found["s"] or "", "lie")
    if found["where"] and not found["where"].endswith("side") and _LAY.search(found.string[: found.start()]):
        return f"{lies} down on {found['where']}"
    return f"{lies} on {found['where']}" if found["where"] else f"{lies} "


def _rolls_onto(found: re.Match[str]) -> str:
    """Return a body that turns over onto the other side than the one on which it lies."""
    onto = "back" if _ON_FRONT.search(found["lies"]) else "stomach"
    return f"{found['lies']}{found['rolls']}{found['how'] or ''} over onto the {onto}"


def _falls_over_knees(found: re.Match[str]) -> str:
    """Return a fall in which the knees come down first."""
    side = "sideways" if "side" in found["how"] else ""
    return f"falls dead over the knees {(found['way'] or '').strip() or side or 'forward'}"


def _kneels(found: re.Match[str]) -> str:
    """Return a body that kneels down on both knees; one that falls does so quickly."""
    kneels = in_form_of(found["end"] or "", "kneel")
    how = found["how"] or (" quickly" if found["fast"] else "")
    return f"{kneels} down{how} on both knees"


def _jumps_over(found: re.Match[str]) -> str:
    """Return a jump over the thing that its name says."""
    return f"{found['jump']} forward over {indefinite_article(found['thing'])} {found['thing']}"


def _knee_strike(found: re.Match[str]) -> str:
    """Return a blow with the knee as a kick, if other blows are named beside it."""
    if not _BLOWS.search(found.string):
        return found[0]
    return f"{found['joint']}kick with the {found['before'] or found['side']} knee"


def _hit(found: re.Match[str]) -> str:
    """Return what happens to who is struck."""
    gets = {"is": "gets", "are": "get", "being": "getting"}.get(found["is"].lower(), found["is"])
    return f"{gets} {found['how'] or ''}hit"
