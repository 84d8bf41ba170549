#pragma once
/// Reads one table of the configuration. Each call states a key with its role, that is, whether the
/// meaning of a reading depends on the key. The same call sets the member from which the options of
/// a driver are made, and adds the value in use to Config::meaning. A key without a role does not
/// compile.
///
///   reading      the meaning of an axis reading depends on it; in machine_hash()
///   measurement  what a tracker or a probe delivers depends on it
///   stated       as reading or measurement, in combination with other keys: the reader adds the
///                result with state()
///   operation    how abbed works: where a device is found, priorities, time-outs, files,
///                uncertainties, limits
///
/// An address (host, port, interface, serial number) is where a device is found, not what it
/// measures: a replaced gateway or a renumbered bus must not end a model. Whether the device at the
/// address belongs to another machine is checked by the identity of the machine, not by its
/// configuration.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/config/meaning.hpp"
#include "abbe/settings/section.hpp"

namespace abbe::daemon {

enum class Role { Reading, Measurement, Stated, Operation };

/// A key with its role. A text is not converted to a Key implicitly.
struct Key {
  std::string_view name;
  Role role;
  /// The value is added to the meaning only if the file has the key, because the key has no
  /// default.
  bool only_if_given = false;
};
[[nodiscard]] constexpr Key reading(std::string_view name) {
  return {name, Role::Reading};
}
[[nodiscard]] constexpr Key measurement(std::string_view name) {
  return {name, Role::Measurement};
}
[[nodiscard]] constexpr Key stated(std::string_view name) {
  return {name, Role::Stated};
}
[[nodiscard]] constexpr Key operation(std::string_view name) {
  return {name, Role::Operation};
}
[[nodiscard]] constexpr Key if_given(Key key) {
  key.only_if_given = true;
  return key;
}

class ClassifiedSection {
 public:
  /// `path`: path of this table in the entries of `meaning`; empty for the whole file.
  ClassifiedSection(Section section, std::string path, Meaning& meaning)
      : section_(std::move(section)), path_(std::move(path)), meaning_(&meaning) {}

  [[nodiscard]] bool present() const noexcept { return section_.present(); }
  [[nodiscard]] bool has(std::string_view key) const { return section_.has(key); }
  [[nodiscard]] std::vector<std::string> keys() const { return section_.keys(); }

  [[nodiscard]] ClassifiedSection child(std::string_view key, Need need = Need::Optional) {
    return {section_.child(key, need), below(key), *meaning_};
  }
  /// A table in which every key is an operation.
  [[nodiscard]] Section operation_table(std::string_view key) { return section_.child(key); }
  /// An array of tables. `label` is the key whose value names an element in the meaning.
  [[nodiscard]] std::vector<ClassifiedSection> children(std::string_view key,
                                                        std::string_view label);

  // The following functions read a value in the same way as those of Section.
  bool get(Key key, double& out, Unit unit, Bounds bounds, Need need = Need::Optional) {
    const bool given = section_.get(key.name, out, unit, bounds, need);
    return add(key, given, number_text(out * unit.per_si));
  }
  bool get(Key key, std::chrono::nanoseconds& out, Unit unit, Bounds bounds,
           Need need = Need::Optional) {
    const bool given = section_.get(key.name, out, unit, bounds, need);
    return add(key, given, number_text(std::chrono::duration<double>{out}.count() * unit.per_si));
  }
  bool get(Key key, std::vector<double>& out, Unit unit, Need need = Need::Optional) {
    const bool given = section_.get(key.name, out, unit, need);
    return add(key, given, numbers_text(out, unit.per_si));
  }
  bool get(Key key, std::string& out, Need need = Need::Optional) {
    const bool given = section_.get(key.name, out, need);
    return add(key, given, out);
  }
  bool get(Key key, std::vector<std::string>& out) {
    const bool given = section_.get(key.name, out);
    return add(key, given, fmt::format("{}", fmt::join(out, ", ")));
  }
  bool get(Key key, bool& out, Need need = Need::Optional) {
    const bool given = section_.get(key.name, out, need);
    return add(key, given, out ? "true" : "false");
  }
  bool get(Key key, std::filesystem::path& out, const std::filesystem::path& base) {
    const bool given = section_.get(key.name, out, base);
    return add(key, given, out.string());
  }
  bool get_maybe_empty(Key key, std::string& out) {
    const bool given = section_.get_maybe_empty(key.name, out);
    return add(key, given, out);
  }
  template <class Integer>
  bool get_integer(Key key, Integer& out, std::int64_t min, std::int64_t max,
                   Need need = Need::Optional) {
    const bool given = section_.get_integer(key.name, out, min, max, need);
    return add(key, given, fmt::format("{}", out));
  }
  /// `words`: texts and their values. If several texts have the same value, the first of them is
  /// used in the meaning.
  template <class Enum>
  bool get_word(Key key, Enum& out, std::vector<std::pair<std::string_view, Enum>> words,
                Need need = Need::Optional) {
    const bool given = section_.get_word(key.name, out, words, need);
    const auto word = std::ranges::find(words, out, &std::pair<std::string_view, Enum>::second);
    return add(key, given, word == words.end() ? std::string{} : std::string{word->first});
  }
  /// The value of a key that may have several types; null if absent.
  [[nodiscard]] const toml::node* node(Key key) const { return section_.node(key.name); }

  /// Adds the common meaning of keys with role `stated`, as entry `name` of this table.
  void state(Role role, std::string_view name, std::string value);

  void fault(std::string_view key, std::string_view what) { section_.fault(key, what); }
  void implausible(std::string_view key, std::string_view what) { section_.implausible(key, what); }
  void close() { section_.close(); }

 private:
  [[nodiscard]] std::string below(std::string_view key) const;
  /// Adds the value to the meaning according to the role of the key. Returns `given`.
  bool add(Key key, bool given, std::string value);

  Section section_;
  std::string path_;
  Meaning* meaning_;
};

}  // namespace abbe::daemon
