"""What a person looks at: figures, pictures, ParaView series, the page of a run."""
