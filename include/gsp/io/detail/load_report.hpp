#pragma once
#include <gsp/model/description.hpp>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace gsp::io::detail {

/// Report lines of one reading, alike ones counted together.
class Report {
 public:
  void add(ReportLine::Kind kind, std::string const& file, int line, std::string const& text) {
    auto const [at, is_new] = index_.try_emplace({int(kind), file, text}, lines_.size());
    if (is_new)
      lines_.push_back({kind, file, line, text, 1});
    else
      ++lines_[at->second].count;
  }
  std::vector<ReportLine> take() { return std::move(lines_); }

 private:
  std::vector<ReportLine> lines_;
  std::map<std::tuple<int, std::string, std::string>, std::size_t> index_;
};

}  // namespace gsp::io::detail
