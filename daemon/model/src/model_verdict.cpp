#include "abbe/model/model_verdict.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "abbe/base/utc_text.hpp"

namespace abbe::daemon {

VerdictState state_of(const std::optional<ModelVerdict>& verdict) noexcept {
  if (!verdict) return VerdictState::NotJudged;
  if (verdict->accepted) return VerdictState::Accepted;
  return verdict->forced ? VerdictState::Forced : VerdictState::Refused;
}

std::string_view name(VerdictState state) noexcept {
  switch (state) {
    case VerdictState::NotJudged:
      return "not judged";
    case VerdictState::Accepted:
      return "accepted";
    case VerdictState::Refused:
      return "refused";
    case VerdictState::Forced:
      return "forced";
  }
  return "";
}

std::string in_one_line(const std::optional<ModelVerdict>& verdict) {
  if (!verdict)
    return "not judged: the file has no verdict of the gate, as files of earlier versions of abbe";
  if (verdict->accepted) return "accepted by the gate";
  const std::string refused =
      fmt::format("refused by the gate{}{}", verdict->reasons.empty() ? "" : ": ",
                  fmt::join(verdict->reasons, "; "));
  if (!verdict->forced) return refused;
  return fmt::format("{}; activated by force by {}", refused, who_and_when(*verdict->forced));
}

std::string who_and_when(const StoreActor& actor) {
  return fmt::format("{}, {} (UTC){}{}", actor.who, to_text(actor.when),
                     actor.why.empty() ? "" : ": ", actor.why);
}

ModelVerdict model_verdict(const calib::Verdict& verdict) {
  return {.accepted = verdict.accepted, .reasons = verdict.reasons, .notes = verdict.notes};
}

}  // namespace abbe::daemon
