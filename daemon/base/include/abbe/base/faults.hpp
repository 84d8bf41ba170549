#pragma once
/// The faults of one input file, gathered so that a person can mend them all at once. Shared by the
/// TOML and CSV readers.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Collects "file:line:column: key: what is wrong", keeps the 20 nearest to the top of the file and
/// counts the rest.
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

/// The one of `known` that `word` was probably meant to be, or empty: a few letters apart, or the
/// same but for its unit.
[[nodiscard]] std::string_view nearest(std::string_view word,
                                       const std::vector<std::string_view>& known);

/// ` (did you mean "x"?)`, or nothing.
[[nodiscard]] std::string suggestion(std::string_view word,
                                     const std::vector<std::string_view>& known);

}  // namespace abbe::daemon
