"""The protocol between OpenFOAM and the fiber daemon: messages, transports, the daemon."""
