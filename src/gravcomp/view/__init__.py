"""The live 3D page of a running robot, with controls. Served by viser, without ROS.

page = Page(robot, PageOptions())       # gravcomp.view.page, gravcomp.view.options
page.show(snapshot)                     # gravcomp.view.snapshot; at any rate: a slow browser drops frames
for request in page.requests(): ...     # gravcomp.view.requests: the user's requests since the last call
"""
