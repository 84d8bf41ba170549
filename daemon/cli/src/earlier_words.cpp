#include "earlier_words.hpp"

#include <string_view>

namespace abbe::daemon {

std::vector<std::string> present_options(std::vector<std::string> words) {
  constexpr std::string_view earlier = "--block-samples", present = "--segment-samples";
  for (std::string& word : words) {
    if (word == "--") break;
    if (word.substr(0, word.find('=')) == earlier) word.replace(0, earlier.size(), present);
  }
  return words;
}

std::string estimator_word(std::string word) {
  return word == "joint" ? "simultaneous" : word;
}

}  // namespace abbe::daemon
