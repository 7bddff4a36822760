"""Another post by the same id is told of where DAPs hand on what it says."""

from __future__ import annotations

from command_post.incident import Incident, IncidentSettings
from command_post.nodes.strangers import twin_remarks
from shared.codec import encode
from shared.messages import DapState
from shared.strangers import NOBODY, AtLinks

SAID = {("dap1", "p"): 3, ("r1", "p"): 1, ("dap1", "r2"): 2}


def test_who_speaks_in_the_posts_name_through_a_dap_is_another_post() -> None:
    incident = Incident(IncidentSettings(incident="fire", post_id="p"))
    state = encode(
        DapState(event_time_ns=0, sequence=0, battery_share=1.0, temperature_c=None, going=None)
    )
    incident.handle("clew/v1/fire/dap/dap1/state", state, 0)
    words = ["another post goes by p too, in reach of dap1: end one"]
    assert twin_remarks(AtLinks({}, SAID), incident) == words
    assert twin_remarks(AtLinks({}, {("r1", "p"): 1, ("dap1", "r2"): 2}), incident) == []
    assert twin_remarks(NOBODY, incident) == []
