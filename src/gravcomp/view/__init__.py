"""The live 3D page: what a browser shows of a running robot, and what people ask for there. Served by viser, without ROS.

page = Page(robot, PageOptions())       # gravcomp.view.page, gravcomp.view.options
page.show(snapshot)                     # gravcomp.view.snapshot; at any rate: a slow browser drops frames
for request in page.requests(): ...     # gravcomp.view.requests: what was asked for since the last call
"""
