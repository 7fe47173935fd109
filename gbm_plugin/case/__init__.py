"""An OpenFOAM case read into one typed scene: its layout, dictionaries, initial fields, preparation."""
