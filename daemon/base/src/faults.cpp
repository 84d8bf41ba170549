#include "abbe/base/faults.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace abbe::daemon {

void Faults::add(std::size_t line, std::size_t column, std::string_view key,
                 std::string_view what) {
  ++count_;
  auto text =
      fmt::format("{}:{}:{}: {}{}{}", file_, line, column, key, key.empty() ? "" : ": ", what);
  const auto later = [](std::size_t l, const Fault& f) { return l < f.line; };
  const auto next_line = std::upper_bound(faults_.begin(), faults_.end(), line, later);

  for (auto same = next_line; same != faults_.begin() && (same - 1)->line == line; --same) {
    if ((same - 1)->text != text) continue;
    ++(same - 1)->times;
    return;
  }

  faults_.insert(next_line, Fault{line, column, std::move(text)});
  if (faults_.size() > most_shown_) faults_.pop_back();
}

std::size_t Faults::dropped() const {
  std::size_t kept = 0;
  for (const auto& fault : faults_) kept += fault.times;
  return count_ - kept;
}

std::vector<std::string> Faults::lines() const {
  std::vector<std::string> lines;
  for (const auto& fault : faults_)
    lines.push_back(fault.times == 1 ? fault.text
                                     : fmt::format("{} ({} times)", fault.text, fault.times));
  if (const auto more = dropped(); more > 0)
    lines.push_back(fmt::format("{}: and {} more", file_, more));
  return lines;
}

Error Faults::to_error() const {
  const std::size_t different = faults_.size() + dropped();
  return {ErrorCode::BadInput,
          fmt::format("{}: {} fault{}", file_, different, different == 1 ? "" : "s"), lines()};
}

namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

/// "min" or "min_m" for "min_mm": the word is right, the unit is not.
bool differs_in_unit(std::string_view word, std::string_view known) {
  const auto stem = known.substr(0, known.rfind('_'));
  return stem.size() < known.size() && (word == stem || word.substr(0, word.rfind('_')) == stem);
}

}  // namespace

std::string_view nearest(std::string_view word, const std::vector<std::string_view>& known) {
  std::string_view best;
  std::size_t best_distance = 1 + std::max<std::size_t>(1, word.size() / 3);
  for (const auto candidate : known) {
    const std::size_t distance =
        differs_in_unit(word, candidate) ? 1 : edit_distance(word, candidate);
    if (distance >= best_distance) continue;
    best = candidate;
    best_distance = distance;
  }
  return best;
}

std::string suggestion(std::string_view word, const std::vector<std::string_view>& known) {
  const auto best = nearest(word, known);
  return best.empty() ? std::string{} : fmt::format(" (did you mean \"{}\"?)", best);
}

}  // namespace abbe::daemon
