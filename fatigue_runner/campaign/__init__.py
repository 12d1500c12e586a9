"""What is run: a campaign file becomes cases, one wind times one integrator each.

Blocks of cases go to the lane kernel on a pool of workers; every finished case becomes a record, a log and a
row of the results table. A run folder can be resumed.
"""

from fatigue_runner.campaign.demand import log_on_demand, make_logs
from fatigue_runner.campaign.run import CampaignInterrupted, run_campaign

__all__ = ["CampaignInterrupted", "log_on_demand", "make_logs", "run_campaign"]
