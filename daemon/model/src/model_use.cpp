#include "abbe/model/model_use.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "abbe/base/printable.hpp"

namespace abbe::daemon {
namespace {

/// The text on one line: spaces for line ends and tabs; other control characters are replaced, so
/// that a terminal does not execute them.
std::string one_line(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return c == '\n' || c == '\r' || c == '\t'; }, ' ');
  return printable_line(text);
}

/// The last event of the model that found drift, unless a person activated the model after it.
const StoreEvent* drift_of(std::span<const StoreEvent> events) {
  for (std::size_t i = events.size(); i > 0; --i) {
    const StoreEvent& event = events[i - 1];
    if (event.action == StoreAction::Drifted) return &event;
    if (event.action != StoreAction::Added) return nullptr;
  }
  return nullptr;
}

/// Adds the verdict. A model that was not judged is not refused: files of earlier versions stay
/// usable, and a file made from such a model states that it was not judged. In contrast, `abbe
/// model activate` refuses it, because a store has the verdict of every model that abbe added.
void add_verdict(const ModelInUse& use, Obstacles& out) {
  const auto& verdict = use.document.verdict;
  const std::string text = "verdict: " + in_one_line(verdict);
  (verdict && !verdict->accepted ? out.refusals : out.statements).push_back(text);
}

/// True if a person accepted the model, made by an earlier version of abbe, for this configuration,
/// and for no other configuration later.
bool accepted_for(std::span<const StoreEvent> events, const std::string& machine_hash) {
  const auto last = std::find_if(events.rbegin(), events.rend(), [](const StoreEvent& event) {
    return !event.accepted_configuration.empty();
  });
  return last != events.rend() && last->accepted_configuration == machine_hash;
}

/// Adds the obstacle of simulated devices. A certificate is for a machine that exists, so it is
/// refused. A control file may be for a simulated control; it states the origin of the model.
void add_simulated(const ModelInUse& use, Obstacles& out) {
  if (!made_on_simulated_devices(use.document).value_or(false)) return;
  auto& list = use.purpose == ModelPurpose::Certificate ? out.refusals : out.statements;
  list.emplace_back(
      "SIMULATED: the model was made on simulated devices and describes no real machine");
}

/// Adds the changes of the machine since the model was made. They are obstacles to a correction,
/// but not to a certificate of what was measured.
void add_later_changes(const ModelInUse& use, Obstacles& out) {
  auto& list = use.purpose == ModelPurpose::Control ? out.refusals : out.statements;
  if (const StoreEvent* drift = drift_of(use.events); drift != nullptr)
    list.push_back("a later run found drift: " + who_and_when(drift->actor));
  if (is_of_another_machine(use))
    list.emplace_back("STALE: the model was made for another machine configuration");
  if (!use.identity_doubt.empty()) list.push_back("STALE: " + use.identity_doubt);
}

}  // namespace

bool is_of_another_machine(const ModelInUse& use) {
  return use.machine_hash && *use.machine_hash != use.document.machine_hash &&
         !accepted_for(use.events, *use.machine_hash);
}

Obstacles obstacles_to_use(const ModelInUse& use) {
  Obstacles found;
  add_verdict(use, found);
  add_simulated(use, found);
  add_later_changes(use, found);
  if (const auto& gap = use.document.recording_gap; !gap.empty())
    found.statements.push_back(cannot_be_checked(gap));

  // Looking at a model is never refused.
  if (use.purpose == ModelPurpose::Look)
    found.statements.insert(found.statements.begin(), found.refusals.begin(), found.refusals.end());
  if (use.purpose == ModelPurpose::Look) found.refusals.clear();
  for (auto* list : {&found.refusals, &found.statements})
    std::ranges::transform(*list, list->begin(), one_line);
  return found;
}

Result<std::vector<std::string>> statements_of_use(const std::string& what,
                                                   const Obstacles& obstacles,
                                                   const std::optional<StoreActor>& forced) {
  if (obstacles.refusals.empty()) return obstacles.statements;
  if (!forced)
    return tl::make_unexpected(
        Error{ErrorCode::Refused,
              fmt::format("{}: the model must not be used; to do it nevertheless, give --force and "
                          "--why REASON, which the file then states",
                          what),
              obstacles.refusals});

  std::vector<std::string> all = obstacles.refusals;
  all.push_back(one_line("USED NEVERTHELESS, forced by " + who_and_when(*forced)));
  all.insert(all.end(), obstacles.statements.begin(), obstacles.statements.end());
  return all;
}

}  // namespace abbe::daemon
