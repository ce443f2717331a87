"""Campaigns: thousands of simulated runs as one call, summarised, compared and reported."""

from truenorth.campaign.comparison import compare
from truenorth.campaign.plan import Plan, read_plan
from truenorth.campaign.run import Campaign, read_campaign, run_campaign
from truenorth.campaign.store import read_table
from truenorth.campaign.summary import outcomes, summarise, time_to_converge

__all__ = [
    "Campaign",
    "Plan",
    "compare",
    "outcomes",
    "read_campaign",
    "read_plan",
    "read_table",
    "run_campaign",
    "summarise",
    "time_to_converge",
]
