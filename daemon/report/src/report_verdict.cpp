#include <fmt/format.h>

#include <algorithm>

#include "abbe/base/utc_text.hpp"
#include "abbe/report/model_words.hpp"
#include "certificate_dates.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

std::string who_and_when(const StoreEvent& event) {
  return fmt::format("{}, {} (UTC){}{}", event.actor.who, to_text(event.actor.when),
                     event.actor.why.empty() ? "" : ": ", event.actor.why);
}

/// Equipment whose calibration was not valid any more on the last day of the measurement; of a model
/// that does not have this day, on the day of its identification.
void add_expired_equipment(const ReportSubject& subject, std::vector<std::string>& notes) {
  const std::string end = measurement_days(subject, nullptr).end;
  const std::string day = end.empty() ? day_of(subject.document.created) : end;
  for (const EquipmentDetails& e : subject.details.equipment)
    if (is_used(e, EquipmentUse::AsFound) && !e.valid_until.empty() && e.valid_until < day)
      notes.push_back(
          fmt::format("equipment \"{}\": its calibration was valid until {}, the model "
                      "was {} {}",
                      e.name, e.valid_until, end.empty() ? "identified" : "measured", day));
}

/// What happened to the model in the store, apart from its verdict.
std::vector<std::string> notes_of(const ReportSubject& subject) {
  std::vector<std::string> notes;
  if (subject.document.run) notes = subject.document.run->notes;
  for (const StoreEvent& event : subject.events) {
    switch (event.action) {
      case StoreAction::Added:
        break;
      case StoreAction::Activated:
        notes.push_back("activated by " + who_and_when(event));
        break;
      case StoreAction::Forced:
        notes.push_back("activated against the verdict by " + who_and_when(event));
        break;
      case StoreAction::RolledBack:
        notes.push_back("activated again by " + who_and_when(event));
        break;
      case StoreAction::Drifted:
        notes.push_back("a later run found drift: " + who_and_when(event));
        break;
      case StoreAction::Removed:
        notes.push_back("removed from the store by " + who_and_when(event));
        break;
    }
  }
  if (const auto& gap = subject.document.recording_gap; !gap.empty()) {
    const std::string note = cannot_be_checked(gap);  // of a run of abbed it is among its notes
    if (std::ranges::find(notes, note) == notes.end()) notes.push_back(note);
  }
  add_expired_equipment(subject, notes);
  return notes;
}

bool has_drifted(const ReportSubject& subject) {
  return !subject.events.empty() && subject.events.back().action == StoreAction::Drifted;
}

}  // namespace

VerdictInWords verdict_in_words(const ReportSubject& subject) {
  VerdictInWords verdict{.text = {}, .reasons = {}, .notes = notes_of(subject)};
  if (!subject.entry) {
    verdict.text = "No verdict: this model is a file; only a store knows the verdict of the gate.";
    return verdict;
  }

  const StoreEntry& entry = *subject.entry;
  const std::string_view state = entry.active ? "It is the active model." : "It is not active.";
  if (!entry.accepted) {
    verdict.signal = Signal::Red;
    verdict.text = fmt::format("Red: the gate refused the model. {}", state);
    verdict.reasons = entry.reasons;
  } else if (has_drifted(subject)) {
    verdict.signal = Signal::Yellow;
    verdict.text = fmt::format("Yellow: accepted, but the machine has changed since. {}", state);
  } else {
    verdict.signal = Signal::Green;
    verdict.text = fmt::format("Green: the gate accepted the model. {}", state);
  }
  return verdict;
}

void add_verdict_of(HtmlReport& page, const ReportSubject& subject) {
  const VerdictInWords verdict = verdict_in_words(subject);
  page.heading("Verdict");
  page.signal(verdict.signal, verdict.text);
  if (!verdict.reasons.empty()) {
    page.paragraph("Reasons:");
    page.list(verdict.reasons);
  }
  if (!verdict.notes.empty()) {
    page.paragraph("Notes, no reasons against the model:");
    page.list(verdict.notes);
  }
}

}  // namespace abbe::daemon
