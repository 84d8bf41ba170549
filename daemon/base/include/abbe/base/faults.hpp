#pragma once
/// The faults of one input file, collected so that the user can correct all of them at once. Used
/// by the TOML and CSV readers.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Collects lines of the form "file:line:column: key: what is wrong". Keeps the `most_shown` that
/// come first in the file and counts the others. A fault that is added several times is one fault
/// with a count.
class Faults {
 public:
  static constexpr std::size_t kShown = 20;  ///< a table may have the same fault in every row

  explicit Faults(std::string file, std::size_t most_shown = kShown)
      : file_(std::move(file)), most_shown_(most_shown) {}
  void add(std::size_t line, std::size_t column, std::string_view key, std::string_view what);
  [[nodiscard]] bool any() const noexcept { return count_ > 0; }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }  ///< of the calls of add()
  [[nodiscard]] Error to_error() const;                                ///< BadInput; needs any()
  /// The lines that are kept, and one that counts the others.
  [[nodiscard]] std::vector<std::string> lines() const;

 private:
  struct Fault {
    std::size_t line, column;
    std::string text;
    std::size_t times = 1;
  };
  [[nodiscard]] std::size_t dropped() const;

  std::string file_;
  std::size_t most_shown_;
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
