#pragma once
/// What gives the axis readings their meaning, as a list of configuration keys with their values in
/// use, defaults included. A model corrects readings, so it is valid only for readings of the same
/// meaning. The list is made while the configuration is read (classified_section.hpp): every key of
/// a device states there whether it belongs to this list. Pure.

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
  /// What the axis readings mean. It is in machine_hash().
  MeaningEntries readings;
  /// What the devices deliver that measure the errors (tracker, probe). A model does not become
  /// wrong when they change or are removed, so this is kept with a model and not in the hash.
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

/// Values with 12 digits, which are more than any of them is known to.
[[nodiscard]] std::string number_text(double value);
[[nodiscard]] std::string numbers_text(const std::vector<double>& values, double per_si);

/// How two lists differ.
struct MeaningDifference {
  /// "[TABLE] was configured, is not": tables and elements that only one of the lists has.
  std::vector<std::string> tables;
  std::vector<std::string> changed;  ///< "[TABLE] X step_nm was 10, is 11"
  /// Entries that only the present list has, of tables and elements that both lists have. An
  /// earlier version of abbe did not have them.
  MeaningEntries added;
};
[[nodiscard]] MeaningDifference difference(const MeaningEntries& before,
                                           const MeaningEntries& present);

/// The keys of `entries` by table: "[daemon] simulated, speed; [TABLE] tpdo".
[[nodiscard]] std::string keys_text(const MeaningEntries& entries);

/// `parts` joined by "; ", at most `most` of them, followed by the number of the others.
[[nodiscard]] std::string listed(const std::vector<std::string>& parts, std::size_t most = 6);

}  // namespace abbe::daemon
