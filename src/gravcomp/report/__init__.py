"""Reports: figures, tables and plots as data, and the HTML page, terminal table and Markdown table made from them."""
