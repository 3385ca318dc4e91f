"""Reports: tables for a paper, figures worth printing and a page, from one results folder."""
