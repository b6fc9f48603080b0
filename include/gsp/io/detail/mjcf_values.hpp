#pragma once
#include <cmath>
#include <gsp/io/detail/decimal.hpp>
#include <gsp/io/detail/mjcf_schema.hpp>
#include <gsp/io/detail/mjcf_xml.hpp>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Attributes as values: an element's own over those of its default class.
namespace gsp::io::detail::mjcf {

inline std::vector<std::string_view> words(std::string_view text) {
  std::vector<std::string_view> out;
  auto const blank = [](char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; };
  for (std::size_t at = 0; at < text.size();) {
    while (at < text.size() && blank(text[at])) ++at;
    std::size_t const begin = at;
    while (at < text.size() && !blank(text[at])) ++at;
    if (at > begin) out.push_back(text.substr(begin, at - begin));
  }
  return out;
}
inline std::optional<double> to_number(std::string_view word) {
  auto const value = decimal(word);
  return value && std::isfinite(*value) ? value : std::nullopt;
}
/// 0, false, none, auto, disable or nothing: a value that asks for no more than leaving the attribute away.
inline bool is_neutral(std::string_view text) {
  for (auto word : words(text))
    if (word != "false" && word != "none" && word != "auto" && word != "disable" && to_number(word) != 0.) return false;
  return true;
}

struct Value {
  std::string text;
  Place place;
};
using Values = std::map<std::string, Value, std::less<>>;  // attribute -> value

/// Lists of which fewer numbers than there are may be given: the others keep what they had.
inline constexpr std::string_view partial_lists =
    "size friction solref solimp solreflimit solimplimit solreffriction solimpfriction gear gainprm biasprm stiffness damping";

/// `next` over `before`, as a default class over its parent.
inline std::string merged(std::string_view attribute, std::string const& before, std::string const& next) {
  if (!is_in(partial_lists, attribute)) return next;
  auto const old = words(before), now = words(next);
  std::string text = next;
  for (std::size_t i = now.size(); i < old.size(); ++i) {
    text += ' ';
    text += old[i];
  }
  return text;
}

class Attributes {
 public:
  Attributes(Files const& files, Node const& node, Values const* defaults) : files_(files), node_(node), defaults_(defaults) {}

  Place const& place() const { return node_.place; }
  bool own(std::string_view name) const { return node_.find(name) != nullptr; }
  bool has(std::string_view name) const { return own(name) || inherited(name); }
  std::string text(std::string_view name, std::string fallback = {}) const {
    if (auto const* v = node_.find(name)) return *v;
    if (auto const* v = inherited(name)) return v->text;
    return fallback;
  }
  [[noreturn]] void fail(std::string_view attribute, std::string const& sentence) const {
    auto const* name = node_.find("name");
    files_.fail(node_.place, "<" + node_.name + (name ? " name=" + in_quotes(*name) : "") +
                                 ">: " + (attribute.empty() ? "" : "attribute '" + std::string(attribute) + "' ") + sentence);
  }

  /// Up to `n` numbers into out[0 .. n); what is not given stays. Returns whether any was. `exact`: all n or none.
  bool numbers(std::string_view name, double* out, std::size_t n, bool exact = true) const {
    bool any = false;
    if (auto const* v = inherited(name)) any |= parse(name, v->text, out, n, exact);
    if (auto const* v = node_.find(name)) any |= parse(name, *v, out, n, exact);
    return any;
  }
  template <std::size_t N>
  bool numbers(std::string_view name, std::array<double, N>& out, bool exact = true) const {
    return numbers(name, out.data(), N, exact);
  }
  bool number(std::string_view name, double& out) const { return numbers(name, &out, 1); }
  std::vector<double> list(std::string_view name) const {
    std::vector<double> out;
    std::string const all = text(name);
    for (auto word : words(all)) out.push_back(to_double(name, word));
    return out;
  }
  bool integer(std::string_view name, int& out) const {
    double value = 0;
    if (!number(name, value)) return false;
    if (value != std::floor(value) || std::abs(value) > 2147483647.) fail(name, "is not a whole number; give one");
    out = static_cast<int>(value);
    return true;
  }
  bool boolean(std::string_view name, bool& out) const {
    if (!has(name)) return false;
    out = choice(name, {"false", "true"}) == 1;
    return true;
  }
  /// Index of the attribute's word in `words`.
  int choice(std::string_view name, std::vector<std::string_view> const& allowed) const {
    std::string const value = text(name);
    for (std::size_t i = 0; i < allowed.size(); ++i)
      if (allowed[i] == value) return static_cast<int>(i);
    std::string list;
    for (auto a : allowed) list += (list.empty() ? "" : ", ") + std::string(a);
    fail(name, "is " + in_quotes(value) + "; give one of: " + list);
  }

 private:
  Value const* inherited(std::string_view name) const {
    if (!defaults_) return nullptr;
    auto const found = defaults_->find(name);
    return found == defaults_->end() ? nullptr : &found->second;
  }
  double to_double(std::string_view name, std::string_view word) const {
    auto const value = to_number(word);
    if (!value && decimal(word) && word.find_first_of("0123456789") != word.npos)
      fail(name, "holds " + in_quotes(word) + ", which is beyond the largest number, 1.8e308; correct it");
    if (!value) fail(name, "holds " + in_quotes(word) + ", which is not a finite number; correct it");
    return *value;
  }
  bool parse(std::string_view name, std::string_view text, double* out, std::size_t n, bool exact) const {
    auto const list = words(text);
    if (list.size() > n || (exact && list.size() < n))
      fail(name, "has " + std::to_string(list.size()) + " numbers; give " + (exact ? "" : "at most ") + std::to_string(n));
    for (std::size_t i = 0; i < list.size(); ++i) out[i] = to_double(name, list[i]);
    return !list.empty();
  }

  Files const& files_;
  Node const& node_;
  Values const* defaults_;
};

}  // namespace gsp::io::detail::mjcf
