#pragma once
/// Options and their values as earlier versions named them.

#include <string>
#include <vector>

namespace abbe::daemon {

/// The `words` of a command line; options that had another name in earlier versions get their
/// present name.
[[nodiscard]] std::vector<std::string> present_options(std::vector<std::string> words);

/// Converts the word "joint" of earlier versions to its present name, the estimator "simultaneous".
/// Other words are returned unchanged.
[[nodiscard]] std::string estimator_word(std::string word);

}  // namespace abbe::daemon
