"""External solvers that take part in campaigns: one plug-in file each, with the line that installs
it. `contactopt.benchmark.peers` says how to declare one.
"""
