#pragma once
// The command line of `gsp`: what a command takes, checked strictly. Every mistake is a gsp::Error of one sentence that names the option
// and the remedy.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <gsp/core/check.hpp>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace gsp_cli {

using gsp::Error;

struct Option {
  std::string name;   // "--worlds"
  std::string value;  // what follows it, as the help names it; empty: a switch
  std::string help;
  bool many = false;  // may come several times
};

class Arguments;
struct Command {
  std::string name, operands, summary;
  int least, most;  // number of operands; most < 0: any
  std::vector<Option> options;
  int (*run)(Arguments const&);
};

inline std::string in_quotes(std::string_view text) {
  std::string out = "'";
  for (char c : text.substr(0, 80)) out += c >= 32 && c != 127 ? c : '?';
  return out + (text.size() > 80 ? "...'" : "'");
}

/// The candidate that takes the fewest edits (insert, delete, replace) to become `word`; empty when none is near.
inline std::string nearest(std::string const& word, std::vector<std::string> const& candidates) {
  std::string best;
  std::size_t least = word.size() / 3 + 2;
  for (auto const& c : candidates) {
    std::vector<std::size_t> row(c.size() + 1);
    for (std::size_t j = 0; j <= c.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= word.size(); ++i) {
      std::size_t diagonal = row[0];
      row[0] = i;
      for (std::size_t j = 1; j <= c.size(); ++j) {
        std::size_t const edit = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (word[i - 1] != c[j - 1])});
        diagonal = row[j];
        row[j] = edit;
      }
    }
    if (row.back() < least) {
      least = row.back();
      best = c;
    }
  }
  return best;
}
inline std::string did_you_mean(std::string const& word, std::vector<std::string> const& candidates) {
  auto const best = nearest(word, candidates);
  return best.empty() ? "" : ", did you mean " + best + "?";
}

/// What was given, by name. `arguments` are the words behind the command's name.
class Arguments {
 public:
  Arguments(Command const& command, std::vector<std::string> const& arguments) : command_(&command) {
    bool only_operands = false;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      std::string word = arguments[i], value;
      if (only_operands || word.size() < 2 || word[0] != '-' ||
          (word[1] != '-' && std::string_view("0123456789.").find(word[1]) != std::string_view::npos)) {
        operands_.push_back(word);
        continue;
      }
      if (word == "--") {
        only_operands = true;
        continue;
      }
      auto const equal = word.find('=');
      bool const inline_value = word.starts_with("--") && equal != std::string::npos;
      if (inline_value) {
        value = word.substr(equal + 1);
        word.resize(equal);
      }
      auto const option = std::find_if(command.options.begin(), command.options.end(), [&](Option const& o) { return o.name == word; });
      if (option == command.options.end()) {
        std::vector<std::string> names;
        for (auto const& o : command.options) names.push_back(o.name);
        auto const hint = did_you_mean(word, names);
        fail(in_quotes(word) + " is no option here" + (hint.empty() ? "; 'gsp " + command.name + " --help' lists them" : hint));
      }
      if (option->value.empty()) {
        if (inline_value) fail(word + " takes no value; leave out " + in_quotes("=" + value));
      } else if (!inline_value) {
        if (i + 1 == arguments.size() || arguments[i + 1].starts_with("--")) fail(word + " needs a value: " + word + " " + option->value);
        value = arguments[++i];
      }
      if (!option->value.empty() && value.empty()) fail(word + " has an empty value; give " + option->value);
      auto& given = given_[word];
      if (!given.empty() && !option->many) fail(word + " is given twice; give it once");
      given.push_back(value);
    }
    int const n = static_cast<int>(operands_.size());
    if (n < command.least) fail("needs " + command.operands + "; 'gsp " + command.name + " --help' explains");
    if (command.most >= 0 && n > command.most)
      fail(in_quotes(operands_[command.most]) + " is one word too many; " +
           (command.most == 0 ? "options start with --" : "it takes " + command.operands));
  }

  std::vector<std::string> const& operands() const { return operands_; }
  bool has(std::string const& name) const { return given_.contains(name); }
  std::vector<std::string> all(std::string const& name) const { return has(name) ? given_.at(name) : std::vector<std::string>{}; }
  std::optional<std::string> text(std::string const& name) const {
    return has(name) ? std::optional(given_.at(name).front()) : std::nullopt;
  }

  long long integer(std::string const& name, long long otherwise, long long least, long long most) const {
    if (!has(name)) return otherwise;
    std::string const& t = given_.at(name).front();
    long long value = 0;
    auto const [end, error] = std::from_chars(t.data(), t.data() + t.size(), value);
    if (error != std::errc{} || end != t.data() + t.size() || value < least || value > most)
      fail(name + " is " + in_quotes(t) + "; give a whole number from " + std::to_string(least) + " to " + std::to_string(most));
    return value;
  }
  /// least < value <= most
  double real(std::string const& name, double otherwise, double above, double most) const {
    return number(name, otherwise, above, most, false);
  }
  double real_from(std::string const& name, double otherwise, double least, double most) const {
    return number(name, otherwise, least, most, true);
  }
  std::string choice(std::string const& name, std::vector<std::string> const& choices, std::string const& otherwise) const {
    if (!has(name)) return otherwise;
    std::string const& t = given_.at(name).front();
    check_choice(name, t, choices);
    return t;
  }
  /// "a,b,c", each once.
  std::vector<std::string> list(std::string const& name, std::vector<std::string> const& choices,
                                std::vector<std::string> const& otherwise) const {
    if (!has(name)) return otherwise;
    std::vector<std::string> out;
    std::string const t = given_.at(name).front() + ",";
    for (std::size_t at = 0, comma; (comma = t.find(',', at)) != std::string::npos; at = comma + 1) {
      std::string const word = t.substr(at, comma - at);
      if (word.empty()) fail(name + " has a comma too many; take it out");
      check_choice(name, word, choices);
      if (std::find(out.begin(), out.end(), word) != out.end()) fail(name + " names " + word + " twice; name it once");
      out.push_back(word);
    }
    return out;
  }
  /// At most one of the two.
  void exclusive(std::string const& a, std::string const& b, std::string const& why) const {
    if (has(a) && has(b)) fail(a + " and " + b + " contradict each other: " + why + "; leave one out");
  }
  void needs(std::string const& a, std::string const& b, std::string const& why) const {
    if (has(a) && !has(b)) fail(a + " needs " + b + ": " + why);
  }
  [[noreturn]] void fail(std::string const& sentence) const { throw Error(command_->name + ": " + sentence); }

 private:
  double number(std::string const& name, double otherwise, double least, double most, bool inclusive) const {
    if (!has(name)) return otherwise;
    std::string const& t = given_.at(name).front();
    double value = 0;
    auto const [end, error] = std::from_chars(t.data(), t.data() + t.size(), value);
    if (error != std::errc{} || end != t.data() + t.size() || !std::isfinite(value) || value < least || (value == least && !inclusive) ||
        value > most)
      fail(name + " is " + in_quotes(t) + "; give a number " + (inclusive ? "from " : "above ") + short_number(least) +
           (inclusive ? " to " : " and up to ") + short_number(most));
    return value;
  }
  void check_choice(std::string const& name, std::string const& t, std::vector<std::string> const& choices) const {
    if (std::find(choices.begin(), choices.end(), t) != choices.end()) return;
    std::string names;
    for (std::size_t i = 0; i < choices.size(); ++i) names += (i == 0 ? "" : i + 1 == choices.size() ? " or " : ", ") + choices[i];
    fail(name + " is " + in_quotes(t) + "; give " + names);
  }
  static std::string short_number(double x) {
    std::string text(32, '\0');
    auto const [end, error] = std::to_chars(text.data(), text.data() + text.size(), x);
    text.resize(static_cast<std::size_t>(end - text.data()));
    return text;
  }

  Command const* command_;
  std::vector<std::string> operands_;
  std::map<std::string, std::vector<std::string>> given_;
};

/// `text` in lines of up to 100 columns; the first starts at `column`, the others at `indent`.
inline std::string wrapped(std::string const& text, std::size_t indent, std::size_t column) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    std::size_t const space = std::min(text.find(' ', at), text.size());
    if (at > 0) {
      bool const full = column + 1 + (space - at) > 100;
      out += full ? '\n' : ' ';
      if (full) out.append(indent, ' ');
      column = full ? indent : column + 1;
    }
    out += text.substr(at, space - at);
    column += space - at;
    at = space + 1;
  }
  return out;
}

/// The help of a command: usage, summary, then its options.
inline std::string help(Command const& command) {
  std::string out = "gsp " + command.name + (command.operands.empty() ? "" : " " + command.operands) +
                    (command.options.empty() ? "" : " [options]") + "\n  " + wrapped(command.summary, 2, 2) + "\n\n";
  std::size_t width = 0;
  for (auto const& o : command.options) width = std::max(width, o.name.size() + o.value.size() + 1);
  for (auto const& o : command.options) {
    std::string const head = o.name + (o.value.empty() ? "" : " " + o.value);
    out += "  " + head + std::string(width - head.size() + 2, ' ') + wrapped(o.help, width + 4, width + 4) + "\n";
  }
  return out;
}

}  // namespace gsp_cli
