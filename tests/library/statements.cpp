// One statement a line in include/gsp, in what is compiled of it (runtime, kernels) and in the examples, which users copy, read from their
// sources: a debugger and a diff show one fact at a time. Faults are
//   a = 1, b = 2;      expressions joined by a comma (declarations of like things, `int a = 1, b = 2;`, are no fault)
//   a = 1; b = 2;      a second statement behind the end of the first (a body in braces on one line holds one statement)
#include <doctest/doctest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace {
namespace fs = std::filesystem;

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

struct Token {
  std::string text;
  int line = 0;
  bool space_before = false, space_behind = false;
  bool word() const { return is_word(text[0]); }
};

// Comments and directives are left out, a literal is the word `_`.
std::vector<Token> tokens_of(std::string const& s) {
  std::vector<Token> tokens;
  std::size_t const n = s.size();
  int line = 1;
  bool line_starts = true;
  auto const at = [&](std::size_t i, std::string const& what) { return s.compare(i, what.size(), what) == 0; };
  for (std::size_t i = 0; i < n;) {
    std::size_t end = i + 1;
    bool code = true, literal = false;
    if (std::isspace(static_cast<unsigned char>(s[i]))) {
      code = false;
    } else if (at(i, "//")) {
      end = std::min(s.find('\n', i), n);
      code = false;
    } else if (at(i, "/*")) {
      end = s.find("*/", i) + 2;
      code = false;
    } else if (s[i] == '#' && line_starts) {
      do end = std::min(s.find('\n', end + 1), n);
      while (end < n && s[end - 1] == '\\');
      code = false;
    } else if (at(i, "R\"")) {
      std::string const close = ")" + s.substr(i + 2, s.find('(', i) - i - 2) + "\"";
      end = s.find(close, i) + close.size();
      literal = true;
    } else if (s[i] == '"' || s[i] == '\'') {
      while (s[end] != s[i]) end += s[end] == '\\' ? 2 : 1;
      ++end;
      literal = true;
    } else if (is_word(s[i])) {
      while (end < n && (is_word(s[end]) || (s[end] == '\'' && std::isdigit(static_cast<unsigned char>(s[i]))))) ++end;
    } else {
      for (char const* more : {"<<<", "::", "->", "<<", "<=", ">="})
        if (end == i + 1 && at(i, more)) end = i + std::string(more).size();
    }
    if (code) {
      bool const before = i > 0 && std::isspace(static_cast<unsigned char>(s[i - 1]));
      bool const behind = end < n && std::isspace(static_cast<unsigned char>(s[end]));
      tokens.push_back({literal ? "_" : s.substr(i, end - i), line, before, behind});
    }
    line += int(std::count(s.begin() + long(i), s.begin() + long(end), '\n'));
    if (s.find('\n', i) < end)
      line_starts = true;
    else if (code)
      line_starts = false;
    i = end;
  }
  return tokens;
}

bool is_one_of(std::string const& text, std::vector<char const*> const& words) {
  return std::any_of(words.begin(), words.end(), [&](char const* w) { return text == w; });
}

// What a statement does, without the `if (...)`, `for (...)`, `else`, `case x:` before it. Brackets stand as "()", "[]", "{}", without
// their inside.
std::vector<Token> body_of(std::vector<Token> t) {
  auto const drop = [&](std::size_t n) { t.erase(t.begin(), t.begin() + long(std::min(n, t.size()))); };
  while (!t.empty()) {
    if (is_one_of(t[0].text, {"else", "do", "[]"})) {
      drop(1);
    } else if (is_one_of(t[0].text, {"if", "for", "while", "switch"})) {
      drop(t.size() > 1 && t[1].text == "constexpr" ? 3 : 2);
    } else if (is_one_of(t[0].text, {"case", "default", "public", "private", "protected"})) {
      auto const colon = std::find_if(t.begin(), t.end(), [](Token const& x) { return x.text == ":"; });
      if (colon == t.end()) return t;
      drop(std::size_t(colon - t.begin()) + 1);
    } else {
      return t;
    }
  }
  return t;
}

// Two words side by side before the first initialiser: a type and a name. A product has a space on both sides of its star, a pointer
// on one (clang-format).
bool is_declaration(std::vector<Token> const& t) {
  if (t[0].text == "return") return false;
  for (std::size_t i = 1; i < t.size() && !is_one_of(t[i].text, {"=", ",", "()", "{}", ";"}); ++i) {
    bool const pointer =
        i > 1 && is_one_of(t[i - 1].text, {"*", "&", "&&"}) && t[i - 2].word() && !(t[i - 1].space_before && t[i].space_before);
    if ((t[i - 1].word() || pointer) && (t[i].word() || (t[i].text == "[]" && t[i].space_before))) return true;
  }
  return false;
}

struct Fault {
  int line;
  std::string what;
};

std::vector<Fault> faults_of(std::string const& source) {
  struct Scope {  // inside of a bracket: the statement that is being read
    Token open;
    std::vector<Token> statement;
  };
  auto const tokens = tokens_of(source);
  std::vector<Fault> faults;
  std::vector<Scope> scopes{{{"{"}, {}}};
  auto const leave_templates = [&] {
    while (scopes.back().open.text == "<" && scopes.size() > 1) scopes.pop_back();
  };
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    Token const& t = tokens[i];
    Token const* const next = i + 1 < tokens.size() ? &tokens[i + 1] : nullptr;
    bool const opens_template = t.text == "<<<" || (t.text == "<" && !t.space_behind && (i == 0 || tokens[i - 1].text != "operator"));
    if (opens_template) {
      scopes.push_back({{"<"}, {}});
    } else if (t.text == ">" && scopes.back().open.text == "<") {
      scopes.pop_back();
    } else if (is_one_of(t.text, {"(", "[", "{"})) {
      scopes.push_back({t, {}});
    } else if (is_one_of(t.text, {")", "]", "}"})) {
      leave_templates();
      if (scopes.size() < 2) return {{t.line, "brackets do not match"}};
      Token bracket = scopes.back().open;
      bracket.text += t.text;
      scopes.pop_back();
      if (t.text == "}") leave_templates();
      auto& statement = scopes.back().statement;
      statement.push_back(bracket);
      bool const goes_on = next && !next->word() && !is_one_of(next->text, {"}", "~", "[", "::", "<"});
      if (t.text == "}" && !goes_on) statement.clear();
    } else if (t.text == ";") {
      leave_templates();
      if (scopes.back().open.text != "{") continue;  // the head of a for
      auto const statement = body_of(std::exchange(scopes.back().statement, {}));
      auto const comma = std::find_if(statement.begin(), statement.end(), [](Token const& x) { return x.text == ","; });
      if (comma != statement.end() && !is_declaration(statement)) faults.push_back({comma->line, "two expressions joined by a comma"});
      if (next && next->line == t.line && next->text != "}") faults.push_back({t.line, "a second statement on the line"});
    } else {
      scopes.back().statement.push_back(t);
    }
  }
  if (scopes.size() != 1) faults.push_back({0, "brackets do not match"});
  return faults;
}

}  // namespace

TEST_CASE("what counts as two statements on a line") {
  for (char const* good : {"int a = 1, b = 2;",
                           "Vec3<R> e = f(a, b), g{1, 2};",
                           "std::pair<int, int> p;",
                           "R const* const p = x, *q = y;",
                           "R *p, *q;",
                           "auto const [a, b] = f(c, d);",
                           "for (i = 0, j = 1; i < n; ++i, --j) f(i, j);",
                           "void f() { return g(a, b); }",
                           "enum class E { a, b };",
                           "X(int a) : a_(a), b_(a) {}",
                           "template <class A, class B> struct C;",
                           "f(a); // b; c",
                           "char const* s = \"a, b; c\"; /* a; b; */",
                           "if (int x = f(); x > 0) return g(x);",
                           "x = {a, b};",
                           "kernel<A, B><<<blocks, threads, 0, stream>>>(a);",
                           "case E::a: return f(a, b);",
                           "#define A a; b\nint c;",
                           "bool operator<(A const& a, B const& b);",
                           "int const k = 1'000, j = ',';",
                           "struct X : A, B {};"})
    CHECK_MESSAGE(faults_of(good).empty(), good);
  for (char const* bad :
       {"a = 1, b = 2;", "if (c) a = 1, b = 2;", "for (int i = 0; i < n; ++i) f(i), g(i);", "f(a); g(b);", "else a = b, c = d;",
        "case E::a: x = 1, y = 2;", "void f() { a = 1; b = 2; }", "if (x) return y; z = 1;", "return a, b;", "++n, m += 2;",
        "void f() { a[0] = x.y, a[1] = x.z; }", "auto const f = [&n](int& at) { at = n, ++n; };", "a.*b = c, d;", "a * b, c;"})
    CHECK_MESSAGE(faults_of(bad).size() == 1, bad);
}

TEST_CASE("one statement a line") {
  fs::path const root = fs::path(GSP_TEST_DIR).parent_path();
  int files = 0;
  for (char const* folder : {"include", "runtime", "kernels", "examples"}) {
    for (auto const& entry : fs::recursive_directory_iterator(root / folder)) {
      if (entry.path().extension() != ".hpp" && entry.path().extension() != ".cpp") continue;
      ++files;
      std::ifstream file(entry.path());
      std::string const source{std::istreambuf_iterator<char>(file), {}};
      auto const name = entry.path().lexically_relative(root).generic_string();
      for (auto const& f : faults_of(source)) CHECK_MESSAGE(false, name, ":", f.line, ": ", f.what, "; give each statement its line");
    }
  }
  CHECK(files > 130);
}
