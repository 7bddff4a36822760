"""Pictures of the commander's page for the documents.

``python -m tests.web.screenshots docs/`` rehearses an exercise (a team searches offices, simulated;
a minute or two), stops it while somebody calls mayday, and looks at the post's page of it with a
real browser: at three sizes, by day and by night.
"""

from __future__ import annotations

import argparse
import tempfile
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from PIL import Image
from playwright.sync_api import Browser, expect

from command_post.fusion.settings import FusionSettings
from command_post.incident import IncidentSettings
from command_post.rehearsing.rehearsal import Agents, rehearse
from shared.exercise import REHEARSAL_INCIDENT
from tests.web.browser import chromium
from tests.web.staged import Staged, staged

SCENARIO, SEED = "offices", 1
SETTINGS = IncidentSettings(incident=REHEARSAL_INCIDENT, fusion=FusionSettings(seed=SEED))
AT_S = 200.0
MOST_BYTES = 150_000
COLOURS = 96


class Look(NamedTuple):
    """A picture: its name, the size of the window, and by what light."""

    name: str
    width: int
    height: int
    theme: str


LOOKS = (
    Look("page_wall_day", 1920, 1080, "day"),
    Look("page_tablet_night", 1024, 768, "night"),
    Look("page_phone_day", 390, 844, "day"),
)


def take(browser: Browser, shown: Staged, look: Look, folder: Path) -> Path:
    """Save a picture of the page. Raises ``ValueError`` if it has grown too large to keep."""
    page = browser.new_page(viewport={"width": look.width, "height": look.height})
    page.add_init_script(f"localStorage.setItem('theme', '{look.theme}')")
    page.goto(shown.url)
    expect(page.locator("#alert-list > li").first).to_contain_text(shown.caller)
    page.get_by_role("button", name=f"Rescue: {shown.caller}").click()
    expect(page.locator("#way-words")).to_contain_text("walking")
    page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
    page.locator("#fit").click()
    page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
    path = folder / f"{look.name}.png"
    # Where there are no Korean letters, the button for them shows boxes.
    page.locator("#language").evaluate("button => { button.hidden = true }")
    with Image.open(BytesIO(page.screenshot())) as picture:
        picture.quantize(COLOURS).save(path, optimize=True)
    page.close()
    if path.stat().st_size > MOST_BYTES:
        raise ValueError(f"{path}: {path.stat().st_size} bytes, {MOST_BYTES} are enough")
    return path


def main() -> None:
    """Take all pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recording", type=Path, help="another exercise, recorded")
    parser.add_argument("--at", type=float, default=AT_S, help="seconds after its beginning")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        recording = given.recording
        if recording is None:
            recording = Path(temporary) / "exercise.mcap"
            agents = Agents(None, raw=False)
            rehearse(SCENARIO, SEED, SETTINGS, recording, agents, replace=False)
        with staged(recording, given.at) as shown, chromium() as browser:
            for look in LOOKS:
                take(browser, shown, look, given.folder)


if __name__ == "__main__":
    main()
