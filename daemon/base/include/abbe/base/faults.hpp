#pragma once
/// The faults of one input file, collected so that the user can correct all of them at once. Used
/// by the TOML and CSV readers.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Collects lines of the form "file:line:column: key: what is wrong". Keeps the 20 that come first
/// in the file and counts the others.
class Faults {
 public:
  static constexpr std::size_t kShown = 20;

  explicit Faults(std::string file) : file_(std::move(file)) {}
  void add(std::size_t line, std::size_t column, std::string_view key, std::string_view what);
  [[nodiscard]] bool any() const noexcept { return count_ > 0; }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] Error to_error() const;  ///< BadInput; needs any()

 private:
  struct Fault {
    std::size_t line, column;
    std::string text;
  };
  std::string file_;
  std::vector<Fault> faults_;
  std::size_t count_ = 0;
};

/// The entry of `known` that is most similar to the misspelt `word`: it differs by a few letters or
/// only in the unit suffix. Empty if no entry is similar.
[[nodiscard]] std::string_view nearest(std::string_view word,
                                       const std::vector<std::string_view>& known);

/// The text ` (did you mean "x"?)`, or an empty string.
[[nodiscard]] std::string suggestion(std::string_view word,
                                     const std::vector<std::string_view>& known);

}  // namespace abbe::daemon
