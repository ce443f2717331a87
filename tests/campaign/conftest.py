"""A campaign that nothing disturbs, for all files to compare with."""

import pytest

from tests.campaign.test_plan import PLAN
from truenorth.campaign import run_campaign


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    return run_campaign(PLAN, folder)
