#pragma once
#include <cmath>
#include <gsp/io/detail/decimal.hpp>
#include <gsp/io/detail/rigid_matrix.hpp>
#include <map>
#include <numbers>
#include <string_view>
#include <vector>

namespace gsp::io::detail {

/// A piece of USD text: a word (name, number, keyword), a text in quotes, a path <...> or asset @...@, or one of ( ) [ ] { } = , ; and the
/// end.
struct UsdaToken {
  enum Kind { word, text, reference, mark, end } kind = end;
  std::string_view value;  // without quotes
  std::size_t line = 1;
  bool is(char c) const { return kind == mark && value[0] == c; }
  bool is(std::string_view w) const { return kind == word && value == w; }
};

/// Cuts USD text into tokens.
class UsdaLexer {
 public:
  UsdaLexer(std::string_view text, std::string name) : text_(text), name_(std::move(name)) { next(); }
  UsdaToken const& token() const { return token_; }
  std::string const& name() const { return name_; }
  [[noreturn]] void fail_here(std::string const& sentence) const { fail(name_, at_line(token_.line), sentence); }

  void next() {
    skip_blanks();
    token_ = {UsdaToken::end, {}, line_};
    if (at_ == text_.size()) return;
    char const c = text_[at_];
    if (c == '"' || c == '\'' || c == '@') {
      std::string const thrice(3, c);
      bool const is_long = text_.substr(at_, 3) == thrice;
      token_.kind = c == '@' ? UsdaToken::reference : UsdaToken::text;
      quoted(is_long ? thrice : std::string(1, c), is_long || c == '@');
    } else if (c == '<') {
      token_.kind = UsdaToken::reference;
      auto const close = text_.find('>', at_);
      if (close == text_.npos) fail_here("a path <...> has no end; the file is cut short or damaged");
      take(close + 1, 1);
    } else if (std::string_view("()[]{}=,;").find(c) != std::string_view::npos) {
      token_.kind = UsdaToken::mark;
      take(at_ + 1, 0);
    } else {
      token_.kind = UsdaToken::word;
      auto const last = text_.find_first_of(" \t\r\n()[]{}=,;\"'@<>#", at_);
      if (last == at_) fail_here("is not USD text here; repair it or save it again with usdcat");
      take(std::min(last, text_.size()), 0);
    }
  }
  /// Goes on if the token is `c`.
  bool accept(char c) {
    if (!token_.is(c)) return false;
    next();
    return true;
  }
  void expect(char c, char const* where) {
    if (!accept(c))
      fail_here(std::string("needs '") + c + "' " + where + " and has " +
                (token_.kind == UsdaToken::end ? "ended" : in_quotes(token_.value)) + "; the file is cut short or damaged");
  }
  /// Passes a value: one token, or all up to the bracket that closes the one that is here.
  void skip_value() {
    std::vector<char> open;
    do {
      if (token_.kind == UsdaToken::end) fail_here("ends inside of a value; the file is cut short");
      for (auto const& [a, b] : {std::pair{'(', ')'}, {'[', ']'}, {'{', '}'}}) {
        if (token_.is(a)) open.push_back(b);
        if (!token_.is(b)) continue;
        if (open.empty() || open.back() != b) fail_here(std::string("has a '") + b + "' that nothing opens; the file is damaged");
        open.pop_back();
      }
      next();
    } while (!open.empty());
  }

 private:
  /// The token ends at `last`, of which `trim` characters at each side are no part of its value.
  void take(std::size_t last, std::size_t trim) {
    token_.value = text_.substr(at_ + trim, last - at_ - 2 * trim);
    for (char const c : text_.substr(at_, last - at_)) line_ += c == '\n';
    at_ = last;
  }
  void quoted(std::string const& quote, bool lines) {
    std::size_t last = at_ + quote.size();
    for (;; ++last) {
      if (last >= text_.size() || (!lines && text_[last] == '\n'))
        fail_here("a text in quotes has no end; the file is cut short or damaged");
      if (text_[last] == '\\' && quote[0] != '@')
        ++last;
      else if (text_.substr(last, quote.size()) == quote)
        break;
    }
    take(last + quote.size(), quote.size());
  }
  void skip_blanks() {
    while (at_ < text_.size()) {
      if (text_[at_] == '\n') ++line_;
      if (std::string_view(" \t\r\n").find(text_[at_]) != std::string_view::npos) {
        ++at_;
      } else if (text_[at_] == '#' || text_.substr(at_, 2) == "//") {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else if (text_.substr(at_, 2) == "/*") {
        auto const close = text_.find("*/", at_ + 2);
        if (close == text_.npos) fail(name_, at_line(line_), "a comment has no end; the file is cut short");
        for (char const c : text_.substr(at_, close - at_)) line_ += c == '\n';
        at_ = close + 2;
      } else {
        return;
      }
    }
  }

  std::string_view text_;
  std::string name_;
  std::size_t at_ = 0, line_ = 1;
  UsdaToken token_;
};

struct UsdaPrim {
  std::string type, label;
  std::size_t line = 0;
  int parent = -1;
  bool needed = false;                               // of Gaussians, or above some
  bool shown = true;                                 // defined and active, as those above it are
  std::map<std::string, std::vector<float>> arrays;  // of Gaussians
  std::map<std::string, std::vector<double>> ops;    // xformOp:..., degree
  std::vector<std::string> op_order;
  std::map<std::string, std::size_t> elsewhere;  // attributes with .timeSamples, .connect and the like, and their lines
  std::string place() const { return "prim " + in_quotes(label) + " (line " + std::to_string(line) + ")"; }
};

struct UsdaLayer {
  std::vector<UsdaPrim> prims;  // parents before their children
  std::string up_axis = "Y";
  double meters_per_unit = 1;
  bool has_unit = false, other_files = false, variants = false;
};

inline double usda_number(UsdaLexer& lexer) {
  auto const value = lexer.token().kind == UsdaToken::word ? decimal(lexer.token().value) : std::nullopt;
  if (!value) lexer.fail_here("needs a number and has " + in_quotes(lexer.token().value) + "; repair or export the file again");
  lexer.next();
  return *value;
}

/// [(1, 2, 3), ...], or without the inner brackets where `width` is 1.
inline std::vector<float> usda_array(UsdaLexer& lexer, std::size_t width) {
  std::vector<float> out;
  lexer.expect('[', "before an array");
  while (!lexer.token().is(']')) {
    if (width > 1) lexer.expect('(', "before a tuple");
    for (std::size_t k = 0; k < width; ++k) {
      if (k > 0) lexer.expect(',', "between numbers");
      out.push_back(static_cast<float>(usda_number(lexer)));
    }
    if (width > 1) lexer.expect(')', "behind a tuple");
    if (!lexer.accept(',') && !lexer.token().is(']'))
      lexer.fail_here("needs ',' or ']' behind an element of an array; the file is cut short or damaged");
  }
  lexer.next();
  return out;
}

/// All numbers of a value, whatever brackets stand round them.
inline std::vector<double> usda_numbers(UsdaLexer& lexer) {
  std::vector<double> out;
  int depth = 0;
  do {
    auto const& t = lexer.token();
    if (t.is('(') || t.is('[')) {
      ++depth;
      lexer.next();
    } else if (t.is(')') || t.is(']')) {
      --depth;
      lexer.next();
    } else if (!(depth > 0 && lexer.accept(','))) {
      out.push_back(usda_number(lexer));
    }
  } while (depth > 0);
  return out;
}

/// The width of an array of Gaussians; 0: it is none.
inline std::size_t usda_width(std::string_view attribute) {
  if (attribute.ends_with('h')) attribute.remove_suffix(1);
  if (attribute == "positions" || attribute == "scales" || attribute == "radiance:sphericalHarmonicsCoefficients") return 3;
  if (attribute == "orientations") return 4;
  return attribute == "opacities" ? 1 : 0;
}

inline constexpr std::string_view usda_gaussians = "ParticleField3DGaussianSplat";

/// A property, from its qualifiers to its metadata.
inline void read_usda_property(UsdaLexer& lexer, UsdaPrim& prim) {
  for (auto q = lexer.token(); q.is("custom") || q.is("uniform") || q.is("varying") || q.is("config") || q.is("prepend") ||
                               q.is("append") || q.is("add") || q.is("delete") || q.is("reorder");
       q = lexer.token())
    lexer.next();
  if (lexer.token().kind != UsdaToken::word)
    lexer.fail_here("needs the type of a property and has " + in_quotes(lexer.token().value) + "; the file is damaged");
  lexer.next();
  if (lexer.accept('[')) lexer.expect(']', "behind '['");
  if (lexer.token().kind == UsdaToken::word) {
    std::string const attribute(lexer.token().value);
    auto const line = lexer.token().line;
    lexer.next();
    bool const gaussians = prim.type == usda_gaussians && prim.shown;
    std::string const plain = attribute.substr(0, attribute.find('.'));
    bool const wanted =
        (gaussians && (usda_width(plain) > 0 || plain == "radiance:sphericalHarmonicsDegree")) || plain.starts_with("xformOp");
    if (wanted && plain != attribute) prim.elsewhere.emplace(plain, line);
    if (lexer.accept('=')) {
      if (!wanted || plain != attribute || lexer.token().is("None")) {
        lexer.skip_value();
      } else if (plain == "xformOpOrder") {
        prim.op_order.clear();
        lexer.expect('[', "before the order of xformOps");
        while (lexer.token().kind == UsdaToken::text) {
          prim.op_order.emplace_back(lexer.token().value);
          lexer.next();
          if (!lexer.accept(',')) break;
        }
        lexer.expect(']', "behind the order of xformOps");
      } else if (auto const width = usda_width(plain); gaussians && width > 0) {
        prim.arrays[plain] = usda_array(lexer, width);
      } else {
        prim.ops[plain] = usda_numbers(lexer);
      }
    }
  } else if (lexer.accept('=')) {  // reorder properties = [...]
    lexer.skip_value();
  }
  if (lexer.token().is('(')) lexer.skip_value();
  lexer.accept(';');
}

/// `( key = value ... )`; f(key, token): of each value that is one token, or begins a list.
template <class F>
void read_usda_metadata(UsdaLexer& lexer, F const& f) {
  if (!lexer.accept('(')) return;
  while (!lexer.accept(')')) {
    if (lexer.token().kind == UsdaToken::end) lexer.fail_here("ends inside of metadata; the file is cut short");
    auto const key = lexer.token();
    if (key.kind != UsdaToken::word) {  // a comment in quotes, or ';'
      lexer.skip_value();
      continue;
    }
    lexer.next();
    if (!lexer.accept('=')) continue;  // prepend, append ... stand before the key
    f(key.value, lexer.token());
    lexer.skip_value();
  }
}

inline UsdaLayer read_usda_layer(Bytes bytes, std::string const& name) {
  if (!starts_with(bytes, "#usda")) fail(name, at_line(1), "does not start with '#usda'; this is no text file of USD");
  UsdaLexer lexer(as_text(bytes), name);
  UsdaLayer layer;
  read_usda_metadata(lexer, [&](std::string_view key, UsdaToken const& value) {
    if (key == "upAxis" && value.kind == UsdaToken::text) layer.up_axis = value.value;
    if (key == "subLayers") layer.other_files = true;
    if (key != "metersPerUnit") return;
    auto const number = value.kind == UsdaToken::word ? decimal(value.value) : std::nullopt;
    if (!number || !(*number > 0) || !std::isfinite(*number))
      fail(name, at_line(value.line), "metersPerUnit must be a positive number; repair the file");
    layer.meters_per_unit = *number;
    layer.has_unit = true;
  });
  if (layer.up_axis != "Y" && layer.up_axis != "Z")
    fail(name, "", "upAxis is " + in_quotes(layer.up_axis) + ", and must be Y or Z; repair the file");
  int inside = -1;
  for (;;) {
    auto const t = lexer.token();
    if (t.kind == UsdaToken::end) break;
    if (t.is('}')) {
      if (inside < 0) lexer.fail_here("has a '}' that nothing opens; the file is damaged");
      inside = layer.prims[static_cast<std::size_t>(inside)].parent;
      lexer.next();
    } else if (t.is("def") || t.is("over") || t.is("class")) {
      lexer.next();
      UsdaPrim prim;
      prim.line = t.line;
      prim.parent = inside;
      prim.shown = t.is("def") && (inside < 0 || layer.prims[static_cast<std::size_t>(inside)].shown);
      if (lexer.token().kind == UsdaToken::word) {
        prim.type = lexer.token().value;
        lexer.next();
      }
      if (lexer.token().kind != UsdaToken::text) lexer.fail_here("needs the name of a prim in quotes; the file is damaged");
      prim.label = lexer.token().value;
      lexer.next();
      read_usda_metadata(lexer, [&](std::string_view key, UsdaToken const& value) {
        if (key == "active" && (value.is("false") || value.is("0"))) prim.shown = false;
        if (key == "references" || key == "payload" || key == "inherits" || key == "specializes") layer.other_files = true;
        if (key == "variants" || key == "variantSets") layer.variants = true;
      });
      lexer.expect('{', "before what a prim holds");
      inside = static_cast<int>(layer.prims.size());
      layer.prims.push_back(std::move(prim));
    } else if (t.is("variantSet")) {
      layer.variants = true;
      lexer.next();
      lexer.skip_value();
      lexer.expect('=', "behind the name of a variant set");
      lexer.skip_value();
    } else if (t.kind == UsdaToken::word && inside >= 0) {
      read_usda_property(lexer, layer.prims[static_cast<std::size_t>(inside)]);
    } else if (t.is("reorder")) {
      while (lexer.token().kind == UsdaToken::word) lexer.next();
      lexer.expect('=', "behind what is put in order");
      lexer.skip_value();
    } else {
      lexer.fail_here(in_quotes(t.value) + " is not understood here; repair the file or save it again with usdcat");
    }
  }
  if (inside >= 0)
    fail(name, at_line(lexer.token().line), layer.prims[static_cast<std::size_t>(inside)].place() + " has no end; the file is cut short");
  return layer;
}

/// Throws where an attribute changes in time or comes from elsewhere.
inline void expect_usda_value(UsdaPrim const& prim, std::string const& attribute, std::string const& name) {
  if (auto const at = prim.elsewhere.find(attribute); at != prim.elsewhere.end())
    fail(name, at_line(at->second),
         in_quotes(attribute) + " changes in time or comes from elsewhere, which is not read; write one value (usdcat --flatten)");
}

/// One xformOp, as `op_order` has it; "xformOp:rotateXYZ:name" and the like, "!invert!" before a translation.
inline AffineMap usda_op(UsdaPrim const& prim, std::string op, std::string const& name) {
  auto const wrong = [&](std::string const& sentence) { fail(name, prim.place(), in_quotes(op) + " " + sentence); };
  bool const invert = op.starts_with("!invert!");
  std::string const attribute = invert ? op.substr(8) : op;
  expect_usda_value(prim, attribute, name);
  auto const found = prim.ops.find(attribute);
  if (found == prim.ops.end()) wrong("is in xformOpOrder and has no value; repair or export the file again");
  auto const& v = found->second;
  std::string kind = attribute.substr(std::min<std::size_t>(8, attribute.size()));
  kind = kind.substr(0, kind.find(':'));
  std::size_t const count = kind == "transform"                                           ? 16
                            : kind == "orient"                                            ? 4
                            : kind == "rotateX" || kind == "rotateY" || kind == "rotateZ" ? 1
                                                                                          : 3;
  if (v.size() != count) wrong("must have " + std::to_string(count) + " numbers; repair or export the file again");
  for (double x : v)
    if (!std::isfinite(x)) wrong("has a number that is not finite; repair or export the file again");
  if (invert && kind != "translate")
    wrong("is not read: of inverted operations only translations are; write one 'xformOp:transform' instead");
  AffineMap map;
  if (kind == "translate") {
    for (std::size_t k = 0; k < 3; ++k) map.t[k] = invert ? -v[k] : v[k];
  } else if (kind == "scale") {
    for (std::size_t k = 0; k < 3; ++k) map.m[4 * k] = v[k];
  } else if (kind == "orient") {  // w x y z
    if (v == std::vector<double>(4)) wrong("has length 0; repair or export the file again");
    map = affine_map({}, {v[0], v[1], v[2], v[3]}, {1, 1, 1});
  } else if (kind == "transform") {  // of row vectors: the offset is the last row
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) map.m[3 * i + j] = v[4 * j + i];
      map.t[i] = v[12 + i];
    }
  } else if (kind.starts_with("rotate") && (kind.size() == 7 || kind.size() == 9)) {  // degrees; rotateXYZ turns about x first
    for (std::size_t k = 6; k < kind.size(); ++k) {
      int const axis = kind[k] - 'X';
      if (axis < 0 || axis > 2) wrong("is no operation that is known here; write 'xformOp:transform' instead");
      double const half = v[count == 1 ? 0 : static_cast<std::size_t>(axis)] * std::numbers::pi / 360;
      std::array<double, 4> q{std::cos(half), 0, 0, 0};
      q[static_cast<std::size_t>(axis) + 1] = std::sin(half);
      map = affine_map({}, q, {1, 1, 1}) * map;
    }
  } else {
    wrong("is no operation that is known here; write 'xformOp:transform' instead");
  }
  return map;
}

}  // namespace gsp::io::detail
