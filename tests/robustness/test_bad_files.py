"""Damaged files of every kind that is read: each is read or refused, and nothing else happens."""

import os
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from robustness.inputs import TARGETS
from robustness.outcomes import Outcome

pytestmark = pytest.mark.nightly

EXAMPLES = {"urdf": 300, "par": 300, "log_csv": 200, "rows": 300}


@pytest.mark.parametrize("name", list(TARGETS))
def test_good_and_bad_files_are_both_among_what_is_drawn(name, tmp_path):
    # an oracle that only ever sees refusals would see nothing
    seen = set()
    for seed in range(200):
        chance = random.Random(f"{name} {seed}")
        data = TARGETS[name].damaged(chance)
        seen.add(TARGETS[name].judged(data, tmp_path, chance))
        if {Outcome.ANSWERED, Outcome.REFUSED} <= seen:
            return
    raise AssertionError(f"of 200 inputs only {seen}")


@pytest.mark.parametrize("name", list(TARGETS))
def test_a_damaged_file_is_read_or_refused(name, tmp_path_factory):
    folder = Path(tmp_path_factory.mktemp(name))
    target = TARGETS[name]
    thorough = os.environ.get("HYPOTHESIS_PROFILE") == "thorough"

    @settings(max_examples=1000 if thorough else EXAMPLES.get(name, 150))
    @given(chance=st.randoms(use_true_random=False))
    def run(chance):
        target.judged(target.damaged(chance), folder, chance)

    run()
