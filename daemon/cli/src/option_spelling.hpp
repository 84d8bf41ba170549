#pragma once
/// Other spellings of options that are accepted.

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace abbe::daemon {

/// `words` with the present name of each option: --step becomes --step-mm where the command has
/// this option and no --step; an earlier name becomes the present one. Words that are no such
/// option, and all words after "--", stay as they are.
[[nodiscard]] std::vector<std::string> present_names(std::vector<std::string> words,
                                                     const CLI::App& app);

/// "joint", the word of earlier versions for the estimator "simultaneous", becomes the latter.
[[nodiscard]] std::string estimator_word(std::string word);

}  // namespace abbe::daemon
