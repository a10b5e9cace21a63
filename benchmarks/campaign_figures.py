def print_figures(lines):
    print(len(lines))
