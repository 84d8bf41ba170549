#pragma once
/// The faults of one input file, collected so that the user can correct all of them at once. Used
/// by the TOML and CSV readers of abbed, abbe and abbe-sim.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::protocol {

/// Collects lines of the form "file:line:column: key: what is wrong". Shows the first `most_shown`
/// faults in the order of the file and counts the others. A fault that is added several times is
/// shown as one fault with a count. If there are more than `kEach` faults of one kind, one line
/// represents all of them: the first fault, then "and 411 more like this".
class Faults {
 public:
  static constexpr std::size_t kShown = 20;
  static constexpr std::size_t kEach = 3;

  explicit Faults(std::string file, std::size_t most_shown = kShown)
      : file_(std::move(file)), most_shown_(most_shown) {}
  /// Faults with equal key and `what` are of one kind; an index in the key ("ball[3]") makes no
  /// difference.
  void add(std::size_t line, std::size_t column, std::string_view key, std::string_view what);
  /// Same as add(), for a `what` that contains a value that differs from line to line: faults with
  /// equal key and equal `kind` are of one kind.
  void add_kind(std::string_view kind, std::size_t line, std::size_t column, std::string_view key,
                std::string_view what);
  [[nodiscard]] bool any() const noexcept { return count_ > 0; }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }  ///< number of calls of add()
  [[nodiscard]] std::string heading() const;                           ///< "t.csv: 3 faults"
  /// The lines for the user: the faults that are shown, and a last line that counts the others.
  [[nodiscard]] std::vector<std::string> lines() const;

 private:
  struct Fault {
    std::size_t line, order;  // order of add(), within a line
    std::string text;
    std::size_t times = 1;
  };
  struct Kind {
    std::string name;
    std::vector<Fault> first = {};  // the first faults, at most kEach, in the order of the file
    std::size_t count = 0;          // a fault that is added several times counts once
  };
  struct Shown {
    const Fault* fault;
    std::size_t stands_for;  // number of faults that the line represents
  };
  [[nodiscard]] static bool is_before(const Fault& a, const Fault& b);
  [[nodiscard]] Kind& kind_named(std::string name);
  [[nodiscard]] std::vector<Shown> shown() const;
  void drop_last_kind();

  std::string file_;
  std::size_t most_shown_;
  std::vector<Kind> kinds_;
  std::size_t count_ = 0;
  std::size_t repeated_ = 0;  // calls of add() with a fault that was already there
};

/// Insertions, deletions and replacements of one character that make `b` from `a` [Levenshtein].
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b);

/// The entry of `known` that is most similar to the misspelt `word`: it differs by a few letters or
/// only in the unit suffix. Empty if no entry is similar.
[[nodiscard]] std::string_view nearest(std::string_view word,
                                       const std::vector<std::string_view>& known);

/// The text ` (did you mean "x"?)`, or an empty string.
[[nodiscard]] std::string suggestion(std::string_view word,
                                     const std::vector<std::string_view>& known);

}  // namespace abbe::protocol
