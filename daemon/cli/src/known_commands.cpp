#include "known_commands.hpp"

#include <fmt/format.h>

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>

#include "abbe/base/faults.hpp"

namespace abbe::daemon {
namespace {

std::vector<std::string> names_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const auto* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(sub->get_name());
  return names;
}

/// The name most similar to `word`. nullopt if none differs by at most a third of its characters,
/// or by two characters for a short word (two exchanged characters count as two): a less similar
/// name is probably not the one that was meant.
std::optional<std::string> nearest_name(const std::string& word,
                                        const std::vector<std::string>& names) {
  const auto distance = [&](const std::string& name) { return edit_distance(word, name); };
  const auto best = std::min_element(names.begin(), names.end(), [&](const auto& a, const auto& b) {
    return distance(a) < distance(b);
  });
  if (best == names.end()) return std::nullopt;

  const std::size_t longest = std::max(word.size(), best->size());
  const std::size_t most = std::min(longest / 2, std::max<std::size_t>(2, longest / 3));
  return distance(*best) <= most ? std::optional{*best} : std::nullopt;
}

Error unknown_word(const std::string& word, const std::string& before,
                   const std::vector<std::string>& names) {
  Error error{ErrorCode::Usage, fmt::format("\"{}{}\" is not a command", before, word)};
  if (const auto name = nearest_name(word, names)) {
    error.text += fmt::format("; the nearest one is `abbe {}{}`", before, *name);
  } else {
    error.text += fmt::format("; known: {}", fmt::join(names, ", "));
  }
  error.details = {before.empty() ? "see `abbe --help`"
                                  : fmt::format("see `abbe {}--help`", before)};
  return error;
}

}  // namespace

std::vector<std::string> command_line(int argc, const char* const* argv) {
  std::vector<std::string> words;
  for (int i = 1; i < argc; ++i) words.emplace_back(argv[i]);
  if (words.empty() || words.front() != "help") return words;
  while (!words.empty() && words.front() == "help") words.erase(words.begin());
  words.emplace_back("--help");
  return words;
}

bool asks_for_help(const std::vector<std::string>& words) {
  return !words.empty() && (words.back() == "--help" || words.back() == "-h");
}

std::optional<Error> unknown_command(const CLI::App& app, const std::vector<std::string>& words,
                                     const std::vector<std::string>& programs) {
  const CLI::App* at = &app;
  std::string before;  // the subcommands before `word`, each followed by a space

  for (const auto& word : words) {
    auto names = names_of(*at);
    if (names.empty() || word.starts_with('-')) return std::nullopt;
    if (std::find(names.begin(), names.end(), word) == names.end()) {
      if (at == &app) names.insert(names.end(), programs.begin(), programs.end());
      return unknown_word(word, before, names);
    }
    at = at->get_subcommand(word);
    before += word + " ";
  }
  return std::nullopt;
}

}  // namespace abbe::daemon
