#include "option_spelling.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace abbe::daemon {
namespace {

/// Names of earlier versions.
constexpr std::array<std::pair<std::string_view, std::string_view>, 1> kEarlierNames{
    {{"--block-samples", "--segment-samples"}}};

constexpr std::array<std::string_view, 7> kUnits{"mm", "um", "m", "deg", "s", "min", "mm-per-min"};

bool has_option(const CLI::App& command, const std::string& name) {
  return command.get_option_no_throw(name) != nullptr;
}

/// nullptr: the command has no such subcommand.
const CLI::App* subcommand(const CLI::App& command, const std::string& word) {
  for (const CLI::App* sub : command.get_subcommands([](const CLI::App*) { return true; }))
    if (sub->check_name(word)) return sub;
  return nullptr;
}

/// `name` if it is no earlier name, and no unit, or more than one, makes it the name of an option.
std::string whole_name(const std::string& name, const CLI::App& command) {
  for (const auto& [earlier, present] : kEarlierNames)
    if (name == earlier) return std::string(present);

  std::vector<std::string> whole;
  for (const std::string_view unit : kUnits) {
    std::string with_unit = name + "-" + std::string(unit);
    if (has_option(command, with_unit)) whole.push_back(std::move(with_unit));
  }
  return whole.size() == 1 ? whole.front() : name;
}

}  // namespace

std::vector<std::string> present_names(std::vector<std::string> words, const CLI::App& app) {
  const CLI::App* command = &app;
  for (std::string& word : words) {
    if (word == "--") break;

    if (word.rfind("--", 0) == 0) {
      const std::size_t end = std::min(word.find('='), word.size());
      const std::string name = word.substr(0, end);
      if (!has_option(*command, name)) word = whole_name(name, *command) + word.substr(end);
    } else if (const CLI::App* sub = subcommand(*command, word)) {
      command = sub;
    }
  }
  return words;
}

std::string estimator_word(std::string word) {
  return word == "joint" ? "simultaneous" : word;
}

}  // namespace abbe::daemon
