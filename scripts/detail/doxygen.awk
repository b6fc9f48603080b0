# Our comments and pages as Doxygen 1.9 reads them (docs/Doxyfile).
# In headers:
#   a comment behind a member documents it;                   int nq;  // numbers of qpos   ->   int nq;  ///< numbers of qpos
#   indented lines of a contract are formulas, as they stand; ///   w = Y z + C p + b
#   what comes behind the arguments is not about the last;
#   a comment before the namespace is about the header.
#   several arguments may share a line.                       @param rows, impulses  after `pgs`
# In pages: headings of those that others link into get the anchors that they have on GitHub, and links to them are such.
# In both: < before a letter is no tag, unless it stands between backticks.

# The text with \< for each < that begins a word outside of backticks.
function plain(text,    out, i, c, code) {
  out = ""
  code = 0
  for (i = 1; i <= length(text); ++i) {
    c = substr(text, i, 1)
    if (c == "`") code = !code
    if (c == "<" && !code && substr(text, i + 1, 1) ~ /[A-Za-z\/]/) c = "\\<"
    out = out c
  }
  return out
}

FILENAME ~ /\.md$/ {
  if ($0 ~ /^```/) fence = !fence
  line = fence ? $0 : plain($0)
  if (!fence && line ~ /^## / && FILENAME ~ /(how_to|tutorial|benchmarks|getting_started|gpu|python|python_tasks|cli)\.md$/) {
    anchor = tolower(substr(line, 4))
    gsub(/[^a-z0-9_ -]/, "", anchor)
    gsub(/ /, "-", anchor)
    line = line " {#" anchor "}"
  }
  if (!fence) gsub(/\]\([^)]*\.md#/, "](@ref ", line)
  print line
  next
}

/^using Bitmap(8|16) = / { next }  # two overloads of one template would be one function to Doxygen

{
  line = $0
  formula = 0
  comment = line ~ /^ *\/\/\/( |$)/
  if (comment && match(line, /^ *\/\/\/ /)) {
    start = substr(line, 1, RLENGTH)
    text = substr(line, RLENGTH + 1)
    after_param = 0
    if (text ~ /^@param/) {
      in_param = 1
      head = text
      sub(/   *[^ ].*$/, "", head)
      tail = substr(text, length(head) + 1)
      gsub(/, /, ",", head)
      text = head tail
    } else if (text !~ /^ /) {
      after_param = in_param
      in_param = 0
    }
    formula = !in_param && text ~ /^  +[^ ]/
    gsub(/eq\. /, "eq.\\ ", text)  # no end of the summary
    line = start (formula ? "    " text : plain(text))
    if (after_param || (formula && !open) || (!formula && open)) line = "///\n" line
  } else {
    in_param = 0
    if (line ~ /[;,]  *\/\/ / && line !~ /^ *\/\//) {
      sub(/\/\/ /, "///< ", line)
      line = plain_tail(line)
    }
  }
  open = formula
  if (comment || (held != "" && line == "")) {
    held = held line "\n"
    next
  }
  if (held != "" && line ~ /^(namespace|#include)/) held = "/// @file\n" held  # about the header
  printf "%s", held
  held = ""
  print line
}

END { printf "%s", held }

# The same for the comment behind a member alone.
function plain_tail(line,    at) {
  at = index(line, "///< ")
  return substr(line, 1, at + 4) plain(substr(line, at + 5))
}
