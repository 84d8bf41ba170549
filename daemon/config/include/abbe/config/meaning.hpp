#pragma once
/// The configuration keys that determine what the axis readings mean, with their values in use,
/// defaults included. A model corrects readings, so it is valid only for readings of the same
/// meaning. The list is made while the configuration is read (classified_section.hpp): the code
/// that reads a key of a device states whether the key belongs to this list. Pure.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace abbe::daemon {

/// A key and its value in the unit of the key: {"encoder.X.step_nm", "10"}. Elements of an array
/// of tables have the name of what they describe (axis, temperature) instead of an index.
struct MeaningEntry {
  std::string key;
  std::string value;
  friend auto operator<=>(const MeaningEntry&, const MeaningEntry&) = default;
};
using MeaningEntries = std::vector<MeaningEntry>;

struct Meaning {
  /// Keys that determine what the axis readings mean. machine_hash() covers these entries.
  MeaningEntries readings;
  /// Keys of the devices that measure the errors (tracker, probe). They are stored with a model,
  /// but machine_hash() does not cover them: a model stays valid when such a device changes or is
  /// removed.
  MeaningEntries measurements;

  friend bool operator==(const Meaning&, const Meaning&) = default;
};

/// Sets `key` to `value`; the entries remain in order of their keys.
void set_entry(MeaningEntries& entries, std::string_view key, std::string value);
/// The value of `key`; null if there is none.
[[nodiscard]] const std::string* value_of(const MeaningEntries& entries, std::string_view key);

/// Replaces all entries except those of the tables `kept` by the entries of `other`.
void take_entries(MeaningEntries& entries, const MeaningEntries& other,
                  const std::vector<std::string_view>& kept);

/// SHA-256 in hex over the entries.
[[nodiscard]] std::string hash_of(const MeaningEntries& entries);

/// Numbers as text with 12 digits, which exceeds the accuracy of every value.
[[nodiscard]] std::string number_text(double value);
[[nodiscard]] std::string numbers_text(const std::vector<double>& values, double per_si);

/// The differences of two lists.
struct MeaningDifference {
  /// Tables and elements that only one of the lists has: "[TABLE] was configured, is not".
  std::vector<std::string> tables;
  /// entries with different values: "[TABLE] X step_nm was 10, is 11"
  std::vector<std::string> changed;
  /// Entries that only the present list has although both lists have their table and element. The
  /// other list was written by an earlier version of abbe, which did not have these keys.
  MeaningEntries added;
};
[[nodiscard]] MeaningDifference difference(const MeaningEntries& before,
                                           const MeaningEntries& present);

/// The keys of `entries` by table: "[daemon] simulated, speed; [TABLE] tpdo".
[[nodiscard]] std::string keys_text(const MeaningEntries& entries);

/// `parts` joined by "; ", at most `most` of them, followed by the number of the others.
[[nodiscard]] std::string listed(const std::vector<std::string>& parts, std::size_t most = 6);

}  // namespace abbe::daemon
