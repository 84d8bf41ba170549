#pragma once
/// Accepts options whose names end in a unit also without the unit.

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::protocol {

/// The full name of the option `name` of `command`: "--step" gives "--step-mm". The result is
/// `name` itself if it is an option, or if not exactly one option begins with it: "--u" does not
/// give "--u-um" if "--u-urad" also exists.
template <class App>
std::string option_with_unit(const App& command, const std::string& name) {
  std::vector<std::string> longer;
  for (const auto* option : command.get_options())
    for (const std::string& long_name : option->get_lnames()) {
      const std::string whole = "--" + long_name;
      if (whole == name) return name;
      if (whole.starts_with(name + "-")) longer.push_back(whole);
    }
  if (longer.size() != 1) return name;

  constexpr std::array<std::string_view, 7> units{"mm", "um", "m", "deg", "s", "min", "mm-per-min"};
  const std::string unit = longer.front().substr(name.size() + 1);
  return std::find(units.begin(), units.end(), unit) != units.end() ? longer.front() : name;
}

/// The `words` of a command line, without the name of the program, with full names of all options.
/// Words after "--" are not changed. The result is in reverse order, as App::parse() expects it.
/// `App`: CLI::App; a template, so that this module does not depend on CLI11.
template <class App>
std::vector<std::string> option_words(const App& app, std::vector<std::string> words) {
  const App* command = &app;
  for (std::string& word : words) {
    if (word == "--") break;

    if (word.starts_with("--")) {
      const std::size_t end = std::min(word.find('='), word.size());
      word = option_with_unit(*command, word.substr(0, end)) + word.substr(end);
      continue;
    }
    for (const App* sub : command->get_subcommands([](const App*) { return true; })) {
      if (!sub->check_name(word)) continue;
      command = sub;
      break;
    }
  }
  std::reverse(words.begin(), words.end());
  return words;
}

}  // namespace abbe::protocol
