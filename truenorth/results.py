"""Who draws and writes each type of result: the one table. A new type is one row here, or one call of `register_result`."""

from __future__ import annotations

from truenorth.core.shown import Views, load, page_of, plot, register_result, save

__all__ = ["RESULTS", "Views", "load", "page_of", "plot", "register_result", "save"]

RESULTS = {
    "truenorth.alignment.result:Alignment": Views(
        plot="truenorth.figures.alignment:plot_alignment",
        files="truenorth.report.files:alignment_files",
        page="truenorth.report.page:alignment_page",
    ),
    "truenorth.navigation.result:Navigation": Views(
        plot="truenorth.figures.navigation:plot_navigation",
        files="truenorth.report.files:navigation_files",
        page="truenorth.report.navigation:navigation_page",
    ),
    "truenorth.quality.inspection:Inspection": Views(
        plot="truenorth.figures.inspection:plot_inspection", files="truenorth.report.files:inspection_files"
    ),
    "truenorth.advice.positions:Advice": Views(
        plot="truenorth.figures.advice:plot_advice", files="truenorth.report.files:summary_file"
    ),
    "truenorth.advice.manoeuvres:ManoeuvreAdvice": Views(
        plot="truenorth.figures.advice:plot_manoeuvres", files="truenorth.report.files:summary_file"
    ),
    "truenorth.simulation.runs:Simulation": Views(
        plot="truenorth.figures.simulation:plot_simulation",
        files="truenorth.report.files:simulation_files",
        archive=False,
    ),
    "truenorth.campaign.run:Campaign": Views(
        plot="truenorth.figures.campaign:plot_campaign",
        files="truenorth.report.campaign:campaign_files",
        archive=False,
        marker="plan.yaml",
        load="truenorth.campaign.run:read_campaign",
    ),
    "truenorth.campaign.tuning:Tuned": Views(
        plot="truenorth.figures.tuning:plot_tuning", files="truenorth.report.files:tuned_files", archive=False
    ),
}

for _kind, _views in RESULTS.items():
    register_result(_kind, _views)
