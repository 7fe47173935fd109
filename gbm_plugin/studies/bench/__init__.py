"""Speed beside error; ratios within one run."""
