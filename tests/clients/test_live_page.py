"""The live page in a real browser, against a server that speaks docs/reference/streams.md and walks by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from marey.motion.skeleton import HUMANML3D
from tests.support import chromium
from tests.support.tab import Tab, open_tab
from tests.support.walker import walker
from tests.support.walking_server import KEY, READER, SECONDS, WalkingServer, walking_server

pytestmark = pytest.mark.slow

HOSTILE = "<img src=x onerror=\"document.body.dataset.taken='yes'\"></li><script>alert(1)</script>"
IN_FORCE = "document.querySelector('#prompts [aria-current=true] .text')?.textContent"


@pytest.fixture(scope="module")
def browser(tmp_path_factory) -> Iterator[Tab]:
    with open_tab(chromium.find(tmp_path_factory.mktemp("browser"))) as tab:
        yield tab


@pytest.fixture
def server() -> Iterator[WalkingServer]:
    with walking_server() as server:
        yield server


@pytest.fixture
def tab(browser: Tab, server: WalkingServer) -> Iterator[Tab]:
    """The page, open, before anything was typed. It has nothing to say on the console when the test is over."""
    browser.size(900, 600)
    browser.prefer("light")
    browser.go(f"{server.url}/live")
    browser.complaints.clear()
    yield browser
    browser.call("Page.navigate", url="about:blank")
    assert browser.complaints == []


def begin(tab: Tab, prompt: str = "a person walks", frames: int = 10) -> None:
    """Start a stream by the keyboard, and wait until some frames are here."""
    tab.type(KEY, "key")
    tab.type(prompt, "prompt")
    tab.press("Enter")
    tab.wait(f"Number(document.body.dataset.frames) >= {frames}")


def state(name: str) -> str:
    return f"document.body.dataset.state === {name!r}"


def root(tab: Tab) -> np.ndarray:
    return np.array([float(x) for x in tab.data["root"].split(",")])


def test_a_prompt_makes_the_figure_walk(tab, server):
    still, standing = tab.picture(), root(tab)
    begin(tab, frames=30)
    tab.wait("Number(document.body.dataset.frame) >= 20")
    assert np.linalg.norm((root(tab) - standing)[[0, 2]]) > 0.5
    assert (np.abs(tab.picture() - still).max(axis=-1) > 40).sum() > 3000
    assert server.bodies == [{"prompt": "a person walks"}]


def test_the_figure_stands_where_the_frames_put_it(tab):
    begin(tab)
    tab.click("pause")
    tab.wait(state("paused"))
    # What was kept back is played to its end.
    tab.wait("Number(document.body.dataset.frame) === Number(document.body.dataset.frames) - 1")
    frame = int(tab.data["frame"])
    tab.wait("document.getElementById('facts').textContent.includes('buffered 0.00 s')")
    assert np.abs(root(tab) - walker(seconds=SECONDS, turn=0.35).root[frame]).max() < 1e-3


def test_seconds_and_seed_are_sent_when_they_are_given(tab, server):
    tab.type("12.5", "seconds")
    tab.type("7", "seed")
    begin(tab)
    assert server.bodies == [{"prompt": "a person walks", "seconds": 12.5, "seed": 7}]


def test_who_waits_is_told_how_many_are_before(tab, server):
    server.hold = True
    tab.type(KEY, "key")
    tab.type("a person walks", "prompt")
    tab.press("Enter")
    tab.wait(state("waiting"))
    tab.wait("document.getElementById('facts').textContent === 'waiting, 1 before it'")
    server.hold = False
    tab.wait(state("live"))


def test_a_steer_is_in_force_once_frames_carry_its_number(tab, server):
    begin(tab)
    tab.wait("document.body.dataset.prompt === '0'")  # a busy machine draws its first frame later
    tab.type("now a jump", "prompt")
    tab.press("Enter")
    tab.wait("document.body.dataset.prompt === '1'")
    assert server.heard == [{"kind": "steer", "prompt": "now a jump"}]
    assert tab.ask(IN_FORCE) == "now a jump"
    assert tab.text("prompts") == f"from 0a person walksfrom {server.walk.prompts[1]['frame']}now a jump"
    tab.wait("document.getElementById('facts').textContent.includes('latency')")


def test_what_a_rewriter_made_of_a_prompt_stands_beside_it(tab, server):
    begin(tab)
    server.walk.prompts[0] |= {"rewritten": "A person strolls.", "not_rewritten": None}
    tab.type("now a jump", "prompt")
    tab.press("Enter")
    tab.wait("document.querySelector('#prompts .text').textContent === 'a person walks (read as: A person strolls.)'")
    tab.wait(f"{IN_FORCE} === 'now a jump'")


def test_a_steer_that_cannot_be_used_is_told_and_the_walk_goes_on(tab):
    begin(tab)
    tab.type("☃", "prompt")
    tab.press("Enter")
    tab.wait("document.getElementById('message').textContent === 'The prompt cannot be used. Use words. '")
    assert "☃" not in tab.text("prompts")
    frames = int(tab.data["frames"])
    tab.wait(f"Number(document.body.dataset.frames) > {frames + 5}")


def test_it_pauses_goes_on_and_stops(tab, server):
    begin(tab)
    tab.click("pause")
    tab.wait(state("paused"))
    assert tab.text("pause") == "Resume"
    frames = len(server.walk.frames)
    tab.click("pause")
    tab.wait(state("live"))
    tab.wait(f"Number(document.body.dataset.frames) > {frames + 5}")
    tab.click("stop")
    tab.wait(state("ended"))
    assert [message["kind"] for message in server.heard] == ["pause", "resume", "stop"]
    assert "made by job job-of-the-clip" in tab.text("message")
    assert tab.ask("location.hash") == ""
    begin(tab, "another one")  # the page is ready for the next
    tab.wait(f"{IN_FORCE} === 'another one'")


def test_it_ends_in_the_pose_of_a_motion(browser, tab, server):
    assert not tab.ask("document.getElementById('motion').offsetParent")
    begin(tab)
    tab.type("another", "motion")
    tab.press("Enter")
    tab.wait("document.getElementById('message').textContent === 'There is no such motion. List motions. '")
    browser.complaints.clear()  # the refusal
    tab.type("motion-of-the-clip", "motion")
    tab.type("12", "pose-frame")
    tab.press("Enter")
    tab.wait(state("ended"))
    assert server.heard == [{"kind": "end", "pose": {"motion": {"id": "motion-of-the-clip", "frame": 12}}}]
    assert not tab.ask("document.getElementById('motion').offsetParent")


def test_the_keyboard_is_enough(tab, server):
    begin(tab)
    tab.press("Escape")  # from the prompt to the view, where letters are keys
    tab.press("Space")
    tab.wait(state("paused"))
    tab.press("Space")
    tab.wait(state("live"))
    tab.press("d")
    assert tab.ask("document.documentElement.dataset.theme") == "dark"
    tab.press("/")
    tab.type("a jump")
    tab.press("Enter")
    tab.wait("document.body.dataset.prompt === '1'")
    assert [message["kind"] for message in server.heard] == ["pause", "resume", "steer"]


def test_a_dropped_socket_goes_on_from_the_next_frame(tab, server):
    begin(tab)
    server.drop()
    tab.wait("document.body.dataset.state !== 'live'")
    have = int(tab.data["frames"])
    tab.wait(f"Number(document.body.dataset.frames) > {have + 10}")
    assert server.opened == [0, have]
    assert (tab.data["state"], tab.data["gaps"]) == ("live", "0")
    assert tab.text("message") == ""


def test_frames_that_are_not_sent_are_counted_and_leapt_over(tab, server):
    begin(tab)
    before = root(tab)
    server.skip = 100
    tab.wait("Number(document.body.dataset.frame) > 100")
    assert tab.data["gaps"] == "1"
    tab.wait("document.getElementById('facts').textContent.endsWith('gaps 1 (100 frames)')")
    assert np.linalg.norm(root(tab) - before) > 1.0


def test_a_page_that_is_loaded_again_watches_the_same_stream(tab, server):
    begin(tab, HOSTILE, frames=20)
    address = tab.ask("location.href")
    assert address == f"{server.url}/live#stream={server.walk.id}"
    made = len(server.walk.frames)
    tab.go(address)  # the key is still in the session of this tab
    tab.wait("Number(document.body.dataset.frames) >= 5")
    assert len(server.bodies) == 1
    assert server.opened[1] >= made
    assert tab.data["gaps"] == "0"


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("marey_00000000_nobody", "The API key was not accepted. This API key is unknown or revoked."),
        (READER, "The API key may not do this. The key 'reader' lacks the scope 'submit'."),
        ("with a space", "This is no API key"),
        ("", "An API key is needed"),
    ],
)
def test_a_key_that_will_not_do_is_told(browser, tab, server, key, told):
    tab.type(key, "key")
    tab.type("a person walks", "prompt")
    tab.press("Enter")
    tab.wait(f"document.getElementById('message').textContent.startsWith({told!r})")
    assert tab.data["state"] == "idle"
    assert tab.ask("document.getElementById('prompt').value") == "a person walks"
    assert server.opened == []
    browser.complaints.clear()  # the browser notes each 401 and 403 by itself


def test_a_key_that_the_socket_does_not_take_is_told(tab, server):
    begin(tab)
    address = tab.ask("location.href")
    tab.ask("sessionStorage.setItem('marey.key', 'marey_00000000_nobody')")
    tab.go(address)
    tab.wait(state("refused"))
    assert tab.text("message") == "The API key was not accepted. This API key is unknown or revoked. "
    tab.type(KEY, "key")
    tab.press("Enter")
    tab.wait(state("live"))


def test_who_has_too_many_streams_is_told_when_to_come_back(browser, tab, server):
    server.full = True
    tab.type(KEY, "key")
    tab.type("a person walks", "prompt")
    tab.press("Enter")
    tab.wait("document.getElementById('message').textContent.endsWith('Stop one. Try again in 30 s.')")
    browser.complaints.clear()


def test_the_key_is_in_no_address_and_not_kept_beyond_the_tab(tab):
    begin(tab)
    addresses = tab.ask("[location.href, ...performance.getEntries().map((entry) => entry.name)]")
    assert not any("marey_" in address for address in addresses)
    assert tab.ask("[sessionStorage.getItem('marey.key'), localStorage.length, document.cookie]") == [KEY, 0, ""]


def test_a_hostile_prompt_is_shown_and_does_nothing(tab):
    begin(tab, HOSTILE)
    tab.wait(IN_FORCE)
    assert tab.ask(IN_FORCE) == HOSTILE
    assert "taken" not in tab.data


def test_a_skeleton_that_nobody_has_dressed_is_drawn_as_bones(tab, server):
    server.skeleton = replace(HUMANML3D, joint_names=tuple(name.upper() for name in HUMANML3D.joint_names))
    begin(tab)
    tab.wait("Number(document.body.dataset.frame) > 5")
    picture = tab.picture()[80:500]
    assert not (picture[..., 0] - picture[..., 2] > 60).any()  # no side is known: nothing orange
    assert (picture.max(axis=-1) < 190).sum() > 500


def test_a_browser_without_webgl_says_so(browser, server):
    browser.go(f"{server.url}/live", before="HTMLCanvasElement.prototype.getContext = () => null;")
    assert browser.data["state"] == "failed"
    assert browser.text("failure").startswith("This browser shows no WebGL")
    assert browser.ask("document.getElementById('send').disabled")


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
def test_all_that_is_to_be_pressed_is_on_the_screen(tab, width, height):
    tab.size(width, height, phone=width < 500)
    controls = "[...document.querySelectorAll('button, input')].filter((each) => each.offsetParent)"
    shown = f"(each) => {width} > 500 || !each.closest('#examples')"  # on a phone, examples scroll within their row
    outside = f"""{controls}.filter({shown}).map((each) => [each.id, each.getBoundingClientRect()]).filter(([, box]) =>
        box.left < 0 || box.top < 0 || box.right > {width} || box.bottom > {height}).map(([id]) => id)"""
    assert tab.ask(f"{controls}.length") >= 10
    assert tab.ask(outside) == []
    begin(tab)
    assert tab.ask(outside) == []


# ---------------------------------------------------------------- the jitter buffer, on a clock of its own
PLAY = """(() => {
  const buffer = new MareyFrames.Buffer(20);
  const frame = (number) => ({ number, prompt: 0, contacts: [], last: false });
  const seen = [];
  let number = 0;
  // 60 pictures a second; frames come as `arrivals` says: how many at which picture.
  for (let picture = 0; picture < %d; picture++) {
    for (let k = (%s)(picture); k > 0; k--) buffer.push(frame(number++), picture / 60);
    const now = buffer.advance(1 / 60);
    if (now) seen.push(now.frame.number + now.share * (now.later.number - now.frame.number));
  }
  return { seen, buffered: buffer.buffered, rate: buffer.rate(%d / 60), gaps: buffer.gaps };
})()"""


def played(tab: Tab, arrivals: str, *, pictures: int = 900) -> tuple[np.ndarray, dict[str, float]]:
    """Frame numbers drawn at 60 pictures a second, and how the buffer stands at the end."""
    answer = tab.ask(PLAY % (pictures, arrivals, pictures))
    return np.array(answer.pop("seen")), answer


def test_frames_that_come_in_heaps_are_played_evenly(tab):
    seen, end = played(tab, "(p) => (p % 12 === 0 ? 4 : 0)")  # four frames, five times a second
    steps = np.diff(seen[120:])
    assert steps.min() > 0.8 * 20 / 60
    assert steps.max() < 1.2 * 20 / 60
    assert end["rate"] == pytest.approx(20, rel=0.15)


def test_it_plays_a_quarter_of_a_second_behind_the_newest_frame(tab):
    _, end = played(tab, "(p) => (p % 3 === 0 ? 1 : 0)")
    assert end["buffered"] == pytest.approx(0.25, abs=0.06)


def test_who_is_behind_catches_up_without_a_leap(tab):
    # Nothing comes for three seconds, then all of it at once.
    seen, end = played(tab, "(p) => (p < 300 ? p % 3 === 0 : p < 480 ? 0 : p === 480 ? 61 : p % 3 === 0)")
    assert np.diff(seen).min() >= 0
    assert np.diff(seen).max() <= 3.01 * 20 / 60
    assert end["buffered"] == pytest.approx(0.25, abs=0.1)


def test_who_is_far_behind_leaps_to_the_newest(tab):
    seen, end = played(tab, "(p) => (p === 300 ? 400 : p % 3 === 0)")
    assert np.diff(seen).max() > 300
    assert end["buffered"] == pytest.approx(0.25, abs=0.06)


# ---------------------------------------------------------------- examples, and the finished clip
def test_an_example_starts_a_stream_and_another_steers_it(tab, server):
    examples = tab.ask("[...document.querySelectorAll('#examples button')].map((each) => each.textContent)")
    assert len(examples) >= 3
    assert tab.ask("document.getElementById('prompt').placeholder") == "describe a motion"
    tab.type(KEY, "key")
    tab.ask("document.querySelectorAll('#examples button')[0].click()")
    tab.wait("Number(document.body.dataset.frames) >= 5")
    tab.ask("document.querySelectorAll('#examples button')[1].click()")
    tab.wait("document.body.dataset.prompt === '1'")
    assert server.bodies == [{"prompt": examples[0]}]
    assert server.heard == [{"kind": "steer", "prompt": examples[1]}]


def test_what_is_wrong_with_the_finished_clip_is_told(tab, server):
    server.flags = ["floating", "popping"]
    begin(tab)
    tab.click("stop")
    tab.wait("document.querySelectorAll('#clip button').length === 2")
    assert tab.ask("document.querySelector('#clip [data-flags]').textContent") == "The clip is floating, popping."


def test_the_finished_clip_is_downloaded_with_the_key_in_a_header(tab, server):
    begin(tab)
    assert tab.ask("document.getElementById('clip').hidden")
    tab.click("stop")
    tab.wait("document.querySelectorAll('#clip button').length === 2")
    assert server.asked == 2  # it was not made yet when it was asked for first
    tab.ask("""(() => {
      const create = document.createElement.bind(document);
      document.createElement = (tag) => {
        const made = create(tag);
        if (tag === 'a') made.click = async () => {
          window.saved = [made.download, await (await fetch(made.href)).text()];
        };
        return made;
      };
      URL.createObjectURL = (blob) => { window.blob = blob; return 'blob:x'; };
      const fetched = fetch;
      window.fetch = async (url, options) => (url === 'blob:x' ? new Response(window.blob) : fetched(url, options));
    })()""")
    tab.ask("document.querySelector('#clip [data-format=bvh]').click()")
    tab.wait("window.saved")
    assert tab.ask("window.saved") == ["歩く.bvh", "content of bvh"]
    begin(tab, "another one")
    assert tab.ask("document.getElementById('clip').hidden")
