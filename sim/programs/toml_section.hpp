#pragma once
/// One table of a TOML file, read key by key. Every fault goes into one list ("file:line:
/// table.key: what is wrong", at most 20), and in a strict table every key that was not read is a
/// fault.

#include <toml++/toml.h>
#include <Eigen/Core>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/sim/error.hpp"

namespace abbe::sim {

class TomlFaults {
 public:
  explicit TomlFaults(std::string file) : file_(std::move(file)) {}
  void add(const toml::node* where, std::string_view key, std::string_view what);
  [[nodiscard]] bool any() const { return count_ > 0; }
  [[nodiscard]] Error error() const { return {ErrorCode::BadInput, text_}; }

 private:
  std::string file_;
  std::string text_;
  std::size_t count_ = 0;
};

struct NumberRange {
  double least;
  double most;
};
inline constexpr NumberRange kAnyNumber{-1e12, 1e12};
inline constexpr NumberRange kPositiveNumber{1e-12, 1e12};
inline constexpr NumberRange kNotNegativeNumber{0.0, 1e12};
inline constexpr double kMilli = 1e-3;
inline constexpr double kMicro = 1e-6;

class TomlSection {
 public:
  /// `table` may be null: then the functions do not change their `value` argument, and faults are
  /// those of the line of `parent`.
  TomlSection(const toml::table* table, std::string name, TomlFaults& faults,
              const toml::node* parent = nullptr)
      : table_(table),
        where_(table != nullptr ? table : parent),
        name_(std::move(name)),
        faults_(faults) {}

  [[nodiscard]] bool present() const { return table_ != nullptr; }
  [[nodiscard]] TomlSection child(std::string_view key);
  [[nodiscard]] std::vector<TomlSection> children(std::string_view key);  ///< of an array of tables
  [[nodiscard]] std::vector<std::string> keys() const;                    ///< in alphabetical order

  /// Each function below sets `value` and returns true if the key is present and valid; else
  /// `value` is unchanged. `scale` converts the file's unit to SI.
  bool number(std::string_view key, double& value, double scale = 1.0,
              NumberRange range = kAnyNumber);
  bool integer(std::string_view key, std::int64_t& value, std::int64_t least, std::int64_t most);
  bool port(std::string_view key, std::uint16_t& value);
  bool text(std::string_view key, std::string& value);
  bool flag(std::string_view key, bool& value);
  /// Not negative; `scale`: of the file's unit, in s.
  bool duration(std::string_view key, std::chrono::nanoseconds& value, double scale = 1.0);
  bool vector(std::string_view key, Eigen::Vector3d& value, double scale = 1.0);

  void fault(std::string_view key, std::string_view what);
  /// Adds a fault for every key that has not been read. The fault names a similar known key or,
  /// without one, all known keys.
  void refuse_unknown_keys();

 private:
  const toml::node* find(std::string_view key);
  [[nodiscard]] std::string path_of(std::string_view key) const;
  [[nodiscard]] std::string unknown(std::string_view key) const;

  const toml::table* table_;
  const toml::node* where_;  ///< whose line is that of a fault
  std::string name_;
  TomlFaults& faults_;
  std::set<std::string, std::less<>> known_;
};

/// BadInput ("FILE:LINE: ..."). A text that exceeds protocol::TomlBounds is BadInput, too, and is
/// not parsed.
[[nodiscard]] Result<toml::table> parse_toml(std::string_view text, const std::string& file);

/// Reads the parts of one file that `reader` knows. Io, or BadInput with every fault at once.
[[nodiscard]] Result<void> read_toml_file(const std::string& file,
                                          const std::function<void(TomlSection)>& reader);

}  // namespace abbe::sim
