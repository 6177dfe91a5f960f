# manual.awk: a manual page in mdoc from what `sonde COMMAND --help --json` prints; several forms
# of a command may follow each other. Variable: date.
function unescape(t) {
  gsub(/\\n/, "\n", t); gsub(/\\t/, "\t", t); gsub(/\\"/, "\"", t); gsub(/\\\\/, "\\", t)
  return t
}
# One word with its macro: options, pages of the manual, environment.
function word(w,   open, tail, body) {
  open = ""; tail = ""; body = w
  if (substr(body, 1, 1) == "(" && body !~ /^\([a-z0-9]+\)/) { open = "( "; body = substr(body, 2) }
  if (match(body, /^sonde-[a-z]+\(1\)/)) {
    tail = substr(body, RLENGTH + 1); body = substr(body, 1, RLENGTH - 3)
    gsub(/./, " &", tail)
    return "\n.Xr " open body " 1" tail "\n"
  }
  if (match(body, /^--?[a-z][a-z0-9-]*/) && (substr(body, 1, 2) == "--" || RLENGTH == 2)) {
    tail = substr(body, RLENGTH + 1); body = substr(body, 2, RLENGTH - 1)
    if (tail !~ /^[.,;:)]*$/) return w
    gsub(/./, " &", tail)
    return "\n.Fl " open body tail "\n"
  }
  return w
}
function text(t,   n, list, k, line, paragraphs, p) {
  gsub(/\\/, "\\e", t)
  line = ""
  n = split(t, list, /[ \n]+/)
  for (k = 1; k <= n; ++k) {
    line = line (line == "" || line ~ /\n$/ ? "" : " ") word(list[k])
    if (list[k] ~ /[a-z0-9)]\.$/ && list[k + 1] ~ /^[A-Z]/) line = line "\n"
  }
  gsub(/ +\n/, "\n", line); gsub(/\n+/, "\n", line); sub(/^\n/, "", line); sub(/\n$/, "", line)
  gsub(/\n\./, "\n\001", line); gsub(/\n'/, "\n\\\\\\&'", line); gsub(/\001/, ".", line)
  if (line ~ /^[.'][a-z]/) line = "\\&" line
  print line
}
# Synopsis of one form: "[--json]" is optional, a word in capitals is a value.
function usage(line,   n, list, k, out, item, depth, lead) {
  gsub(/\[/, " [ ", line); gsub(/\]/, " ] ", line); gsub(/\(/, " ( ", line); gsub(/\)/, " ) ", line)
  n = split(line, list, / +/); depth = 0; out = ""
  for (k = 1; k <= n; ++k) {
    item = list[k]
    if (item == "") continue
    if (item == "[" || item == "(") {
      out = out (depth++ ? (item == "[" ? " Oo" : " Po") : (item == "[" ? "\n.Op" : "\n.Pq"))
      continue
    }
    if (item == "]" || item == ")") {
      if (--depth) out = out (item == "]" ? " Oc" : " Pc")
      continue
    }
    lead = item == "--" ? "Fl -" : item ~ /^-/ ? "Fl " substr(item, 2) : item == "|" ? "|" : "Ar " item
    if (depth || (item !~ /^-/ && out ~ /\n\.Fl [^\n ]+$/)) out = out " " lead
    else out = out "\n." lead
  }
  return substr(out, 2)
}
function flush_option() {
  if (name == "") return
  if (kind == "group") { print ".El\n.Pp"; print name ":\n.Bl -tag -width Ds"; name = ""; return }
  if (kind == "argument") { print ".It Ar " name; text(help); name = ""; return }
  print ".It Fl " substr(name, 2) (long_name == "" ? "" : " , Fl -" long_name) (value == "" ? "" : " Ar " value)
  text(help (help ~ /\.$/ ? "" : "."))
  name = ""
}
function header() {
  flush_option()
  if (forms++) { print ".El"; return }
  print ".Dd " date "\n.Dt SONDE-" toupper(command) " 1\n.Os\n.Sh NAME\n.Nm sonde-" command "\n.Nd " summary
}
function body(   n, lines, k) {
  if (forms == 1) {
    print ".Sh SYNOPSIS"
    n = split(synopsis, lines, "\n")
    for (k = 1; k <= n; ++k) { print ".Nm sonde " command; print usage(lines[k]) }
    print ".Sh DESCRIPTION"
    text(description)
  } else {
    print ".Pp"
    text(description)
  }
  print ".Bl -tag -width Ds"
}
{
  if ($0 !~ /^ *"[a-z_0-9 .-]+": /) {
    if ($0 ~ /^    \}/) flush_option()
    if ($0 ~ /^ *\},?$/ && inwords) inwords = 0
    next
  }
  key = $0; sub(/^ *"/, "", key); sub(/": .*/, "", key)
  content = $0; sub(/^[^:]*: /, "", content); sub(/,$/, "", content)
  if (content ~ /^"/) content = unescape(substr(content, 2, length(content) - 2))
  if (inwords) next
  if (key == "command") command = content
  else if (key == "summary") { summary = content; header() }
  else if (key == "usage") synopsis = content
  else if (key == "text") description = content
  else if (key == "tail") tail[forms] = content
  else if (key == "options") body()
  else if (key == "name") { name = content; kind = value = help = long_name = "" }
  else if (key == "long_name") long_name = content
  else if (key == "kind") kind = content
  else if (key == "value") value = content
  else if (key == "words") inwords = 1
  else if (key == "help") help = content
}
END {
  flush_option()
  print ".It Fl -help\nPrint the options; with\n.Fl -json\nas JSON.\n.El"
  for (k = 1; k <= forms; ++k) if (k in tail) { print ".Pp"; text(tail[k]) }
}
