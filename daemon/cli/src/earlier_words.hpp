#pragma once
/// Options and their values as earlier versions named them.

#include <string>
#include <vector>

namespace abbe::daemon {

/// `words` of a command line with the present name of each option that had another one.
[[nodiscard]] std::vector<std::string> present_options(std::vector<std::string> words);

/// "joint", an earlier word for the estimator "simultaneous", becomes the latter.
[[nodiscard]] std::string estimator_word(std::string word);

}  // namespace abbe::daemon
