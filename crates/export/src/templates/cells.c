static char *next_cell(char **line)
{
    char *cell = *line, *end;

    if (!cell) {
        return cell;
    }
    cell += strspn(cell, " \t");
    end = cell + strcspn(cell, ",\r\n");
    *line = *end == ',' ? end + 1 : (char *)0;
    while (end > cell && (end[-1] == ' ' || end[-1] == '\t')) {
        end--;
    }
    *end = 0;
    return cell;
}
