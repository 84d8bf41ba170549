#include "abbe/protocol/table/faults.hpp"

#include <algorithm>
#include <utility>

#include "abbe/protocol/printable.hpp"

namespace abbe::protocol {

namespace {

/// The key without the numbers of its elements: "ball[].radius_mm" for "ball[3].radius_mm".
std::string without_indices(std::string_view key) {
  std::string result;
  for (const char c : key) {
    const bool index = c >= '0' && c <= '9' && result.ends_with('[');
    if (!index) result += c;
  }
  return result;
}

}  // namespace

void Faults::add(std::size_t line, std::size_t column, std::string_view key,
                 std::string_view what) {
  add_kind(what, line, column, key, what);
}

void Faults::add_kind(std::string_view kind_name, std::size_t line, std::size_t column,
                      std::string_view key, std::string_view what) {
  ++count_;
  Kind& kind = kind_named(without_indices(key) + "\n" + std::string(kind_name));
  auto& first = kind.first;
  if (first.size() == kEach && first.back().line < line) {
    ++kind.count;
    return;
  }

  auto text = file_ + ":" + std::to_string(line) + ":" + std::to_string(column) + ": ";
  if (!key.empty()) text += printable_line(key) + ": ";
  text += printable_line(what);

  for (auto& fault : first) {
    if (fault.line != line || fault.text != text) continue;
    ++fault.times;
    ++repeated_;
    return;
  }

  ++kind.count;
  const auto later = [](std::size_t l, const Fault& f) { return l < f.line; };
  first.insert(std::upper_bound(first.begin(), first.end(), line, later),
               Fault{line, count_, std::move(text)});
  if (first.size() > kEach) first.pop_back();
  if (kinds_.size() > most_shown_) drop_last_kind();
}

Faults::Kind& Faults::kind_named(std::string name) {
  const auto found = std::find_if(kinds_.begin(), kinds_.end(),
                                  [&](const Kind& kind) { return kind.name == name; });
  return found != kinds_.end() ? *found : kinds_.emplace_back(Kind{std::move(name)});
}

bool Faults::is_before(const Fault& a, const Fault& b) {
  return std::pair(a.line, a.order) < std::pair(b.line, b.order);
}

void Faults::drop_last_kind() {
  kinds_.erase(std::max_element(kinds_.begin(), kinds_.end(), [](const Kind& a, const Kind& b) {
    return is_before(a.first.front(), b.first.front());
  }));
}

std::vector<Faults::Shown> Faults::shown() const {
  std::vector<Shown> shown;
  for (const auto& kind : kinds_) {
    if (kind.count > kEach)
      shown.push_back({&kind.first.front(), kind.count});
    else
      for (const auto& fault : kind.first) shown.push_back({&fault, 1});
  }

  std::sort(shown.begin(), shown.end(),
            [](const Shown& a, const Shown& b) { return is_before(*a.fault, *b.fault); });
  if (shown.size() > most_shown_) shown.resize(most_shown_);
  return shown;
}

std::vector<std::string> Faults::lines() const {
  std::vector<std::string> lines;
  std::size_t more = count_ - repeated_;
  for (const auto& [fault, stands_for] : shown()) {
    std::string line = fault->text;
    if (fault->times > 1) line += " (" + std::to_string(fault->times) + " times)";
    if (stands_for > 1) line += ", and " + std::to_string(stands_for - 1) + " more like this";
    lines.push_back(std::move(line));
    more -= stands_for;
  }

  if (more > 0) lines.push_back(file_ + ": and " + std::to_string(more) + " more");
  return lines;
}

std::string Faults::heading() const {
  const std::size_t different = count_ - repeated_;
  return file_ + ": " + std::to_string(different) + (different == 1 ? " fault" : " faults");
}

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

namespace {

/// True if only the unit differs, such as "min" or "min_m" for "min_mm".
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
  return best.empty() ? std::string{} : " (did you mean \"" + std::string(best) + "\"?)";
}

}  // namespace abbe::protocol
