"""The `hgs` command line, the web service and the viewer."""
