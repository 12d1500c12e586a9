"""What is seen: logs in Rerun, as a moving turbine beside the plots of its loads; replayed, or live.

`scene`, `inflow`, `shapes` and `colours` are plain arrays; `cases` reads the logs that are asked for; `recording`,
`wind_scene`, `styles` and `blueprint` need Rerun (the extra `view`); `window` starts its viewer; `commands` is `fatigue-runner view`.
`live` starts the separate process `bridge`, which follows a running campaign. Nothing here runs a simulation,
and nothing imports Rerun before it is used.
"""

from fatigue_runner.viewer.window import view

__all__ = ["view"]
