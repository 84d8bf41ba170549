#pragma once
/// Reads one table of a TOML file. Every get() names the key, its unit and its bounds. A fault is
/// added to the list and reading continues. close() adds a fault for every key that was not read. A
/// Section of an absent table leaves all defaults, so that readers need no special case.

#include <toml++/toml.h>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/protocol/table/faults.hpp"

namespace abbe::sections {

using protocol::Faults;

/// Conversion of a number in the file to SI:
///
///   SI value = number / per_si
///
/// per_si: numbers in the file per SI unit, for example 1000 for mm. With a division 300 mm is
/// exactly the double 0.3.
struct Unit {
  double per_si = 1.0;
};
inline constexpr Unit kPlain{1.0};
inline constexpr Unit kMilli{1e3};
inline constexpr Unit kMicro{1e6};
inline constexpr Unit kNano{1e9};

/// Closed bounds, in the unit of the file.
struct Bounds {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};
inline constexpr Bounds kAny{};
inline constexpr Bounds kPositive{std::numeric_limits<double>::min(),
                                  std::numeric_limits<double>::infinity()};
inline constexpr Bounds kNotNegative{0.0, std::numeric_limits<double>::infinity()};

enum class Need { Optional, Required };

/// Recorded: the configuration was read from the recording of a completed run. Its values are not
/// checked for plausibility, so that a limit added to a later version does not make the recording
/// unreadable.
enum class Origin { Written, Recorded };

/// What the fault of an unknown key names: a similar key; or, if there is none, all keys.
enum class Hint { SimilarKey, AllKeys };

class Section {
 public:
  Section(const toml::table* table, std::string path, toml::source_position where, Faults& faults,
          Origin origin = Origin::Written);

  [[nodiscard]] bool present() const noexcept { return table_ != nullptr; }
  [[nodiscard]] bool has(std::string_view key) const;  ///< also marks the key as known
  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  /// The value of a key that may have several types; null if absent.
  [[nodiscard]] const toml::node* node(std::string_view key) const;
  [[nodiscard]] std::vector<std::string> keys() const;
  [[nodiscard]] Section child(std::string_view key, Need need = Need::Optional);
  [[nodiscard]] std::vector<Section> children(std::string_view key);  ///< an array of tables

  bool get(std::string_view key, double& out, Unit unit, Bounds bounds, Need need = Need::Optional);
  bool get(std::string_view key, std::string& out, Need need = Need::Optional);  ///< not empty
  bool get_maybe_empty(std::string_view key, std::string& out);
  bool get(std::string_view key, bool& out, Need need = Need::Optional);
  bool get(std::string_view key, std::chrono::nanoseconds& out, Unit unit, Bounds bounds,
           Need need = Need::Optional);
  bool get(std::string_view key, std::vector<double>& out, Unit unit, Need need = Need::Optional);
  bool get(std::string_view key, std::vector<std::string>& out);
  template <class Integer>
  bool get_integer(std::string_view key, Integer& out, std::int64_t min, std::int64_t max,
                   Need need = Need::Optional);
  /// Reads a text that must be one of the first elements of `words`; sets `out` to the enumerator
  /// beside it. `earlier`: words of earlier versions, which are read, too; no fault names them.
  template <class Enum>
  bool get_word(std::string_view key, Enum& out,
                std::vector<std::pair<std::string_view, Enum>> words, Need need = Need::Optional,
                const std::vector<std::pair<std::string_view, Enum>>& earlier = {});
  /// A path; a relative path is relative to `base`.
  bool get(std::string_view key, std::filesystem::path& out, const std::filesystem::path& base);

  /// Adds a fault at the position of the key, or of the table if the key is absent.
  void fault(std::string_view key, std::string_view what);
  /// As fault(), for a value that could be used but that no real machine has. Does nothing if the
  /// origin is Recorded.
  void implausible(std::string_view key, std::string_view what);
  /// Adds a fault for every key that was not read. Call it last.
  void close(Hint hint = Hint::SimilarKey);

 private:
  [[nodiscard]] const toml::node* find(std::string_view key, Need need);
  void fault_at(toml::source_position at, std::string_view key, std::string_view what);
  [[nodiscard]] std::string full(std::string_view key) const;
  /// Adds a fault if a text contains a control character, which a terminal would execute.
  void check_characters(std::string_view key, std::string_view value);
  bool take_integer(std::string_view key, std::int64_t& out, std::int64_t min, std::int64_t max,
                    Need need);
  /// `current`: the first ones of `words`, which a fault names.
  bool take_word(std::string_view key, std::size_t& out, const std::vector<std::string_view>& words,
                 std::size_t current, Need need);

  const toml::table* table_;
  std::string path_;
  toml::source_position where_;
  Faults* faults_;
  Origin origin_;
  mutable std::vector<std::string> known_;
};

template <class Integer>
bool Section::get_integer(std::string_view key, Integer& out, std::int64_t min, std::int64_t max,
                          Need need) {
  std::int64_t value = 0;
  if (!take_integer(key, value, min, max, need)) return false;
  out = static_cast<Integer>(value);
  return true;
}

template <class Enum>
bool Section::get_word(std::string_view key, Enum& out,
                       std::vector<std::pair<std::string_view, Enum>> words, Need need,
                       const std::vector<std::pair<std::string_view, Enum>>& earlier) {
  const std::size_t current = words.size();
  words.insert(words.end(), earlier.begin(), earlier.end());
  std::vector<std::string_view> names;
  names.reserve(words.size());
  for (const auto& [name, value] : words) names.push_back(name);
  std::size_t index = 0;
  if (!take_word(key, index, names, current, need)) return false;
  out = words[index].second;
  return true;
}

/// Reads three numbers.
template <class Vector>
bool get_vector(Section& section, std::string_view key, Vector& out, Unit unit,
                Need need = Need::Optional) {
  std::vector<double> given;
  if (!section.get(key, given, unit, need)) return false;
  if (given.size() == 3) {
    out = {given[0], given[1], given[2]};
    return true;
  }
  section.fault(key, "must be three numbers, x, y, z");
  return false;
}

}  // namespace abbe::sections
