#include "abbe/config/meaning.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "abbe/base/sha256.hpp"

namespace abbe::daemon {
namespace {

std::string_view table_in(std::string_view key) {
  return key.substr(0, key.find('.'));
}

/// The table and element of a key: the key without its last part.
std::string_view place_of(std::string_view key) {
  const auto dot = key.rfind('.');
  return dot == std::string_view::npos ? std::string_view{} : key.substr(0, dot);
}

/// The text for a key: "[TABLE] X step_nm" for "TABLE.X.step_nm".
std::string key_text(std::string_view key) {
  const auto table = table_in(key);
  std::string rest{key.substr(std::min(key.size(), table.size() + 1))};
  std::ranges::replace(rest, '.', ' ');
  return rest.empty() ? fmt::format("[{}]", table) : fmt::format("[{}] {}", table, rest);
}

std::string value_text(const std::string& value) {
  constexpr std::size_t kLongest = 60;
  if (value.empty()) return "\"\"";
  return value.size() <= kLongest ? value : value.substr(0, kLongest) + "...";
}

std::set<std::string_view> places_in(const MeaningEntries& entries) {
  std::set<std::string_view> places;
  for (const auto& entry : entries)
    for (auto place = place_of(entry.key); !place.empty(); place = place_of(place))
      places.insert(place);
  return places;
}

/// The outermost table or element of `key` that is not in `places`; empty: all of them are.
std::string_view missing_place(std::string_view key, const std::set<std::string_view>& places) {
  std::string_view missing;
  for (auto place = place_of(key); !place.empty(); place = place_of(place))
    if (!places.contains(place)) missing = place;
  return missing;
}

}  // namespace

void set_entry(MeaningEntries& entries, std::string_view key, std::string value) {
  const auto at = std::ranges::lower_bound(entries, key, {}, &MeaningEntry::key);
  if (at != entries.end() && at->key == key)
    at->value = std::move(value);
  else
    entries.insert(at, {std::string{key}, std::move(value)});
}

const std::string* value_of(const MeaningEntries& entries, std::string_view key) {
  const auto at = std::ranges::lower_bound(entries, key, {}, &MeaningEntry::key);
  return at != entries.end() && at->key == key ? &at->value : nullptr;
}

void take_entries(MeaningEntries& entries, const MeaningEntries& other,
                  const std::vector<std::string_view>& kept) {
  const auto is_kept = [&kept](const MeaningEntry& entry) {
    return std::ranges::find(kept, table_in(entry.key)) != kept.end();
  };
  std::erase_if(entries, [&](const MeaningEntry& entry) { return !is_kept(entry); });
  for (const auto& entry : other)
    if (!is_kept(entry)) set_entry(entries, entry.key, entry.value);
}

std::string hash_of(const MeaningEntries& entries) {
  // Each text is preceded by its length, so that different lists give different byte streams.
  std::string text = "abbe/meaning/2";
  for (const auto& [key, value] : entries)
    text += fmt::format("|{} {} {} {}", key.size(), key, value.size(), value);
  return sha256_hex(text);
}

std::string number_text(double value) {
  return fmt::format("{:.12g}", value + 0.0);  // the sum turns minus zero into zero
}

std::string numbers_text(const std::vector<double>& values, double per_si) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(number_text(value * per_si));
  return fmt::format("{}", fmt::join(texts, ", "));
}

MeaningDifference difference(const MeaningEntries& before, const MeaningEntries& present) {
  MeaningDifference out;
  const auto places_before = places_in(before), places_present = places_in(present);
  std::set<std::string_view> named;
  const auto name_place = [&](std::string_view place, std::string_view what) {
    if (named.insert(place).second) out.tables.push_back(key_text(place) + std::string{what});
  };

  for (const auto& [key, value] : before) {
    if (const auto place = missing_place(key, places_present); !place.empty())
      name_place(place, " was configured, is not");
    else if (const auto* now = value_of(present, key); now == nullptr)
      out.changed.push_back(key_text(key) + " was " + value_text(value) + ", is not given");
    else if (*now != value)
      out.changed.push_back(
          fmt::format("{} was {}, is {}", key_text(key), value_text(value), value_text(*now)));
  }

  for (const auto& [key, value] : present) {
    if (const auto place = missing_place(key, places_before); !place.empty())
      name_place(place, " was not configured, is now");
    else if (value_of(before, key) == nullptr)
      out.added.push_back({key, value});
  }

  return out;
}

std::string keys_text(const MeaningEntries& entries) {
  std::map<std::string_view, std::set<std::string_view>> keys;
  for (const auto& [key, value] : entries)
    keys[table_in(key)].insert(std::string_view{key}.substr(key.rfind('.') + 1));
  std::vector<std::string> texts;
  for (const auto& [table, names] : keys)
    texts.push_back(fmt::format("[{}] {}", table, fmt::join(names, ", ")));
  return fmt::format("{}", fmt::join(texts, "; "));
}

std::string listed(const std::vector<std::string>& parts, std::size_t most) {
  const std::size_t shown_parts = std::min(parts.size(), most);
  std::string text = fmt::format(
      "{}",
      fmt::join(parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(shown_parts), "; "));
  if (parts.size() > most) text += fmt::format("; and {} more", parts.size() - most);
  return text;
}

}  // namespace abbe::daemon
