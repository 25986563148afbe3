"""Reports: figures, tables and plots as data, and the HTML page, the terminal table and the Markdown table made of them."""
