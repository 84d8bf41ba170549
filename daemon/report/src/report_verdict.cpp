#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/base/utc_text.hpp"
#include "abbe/report/calibration_certificate.hpp"
#include "abbe/report/model_words.hpp"
#include "certificate_dates.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

/// Adds equipment whose calibration was no longer valid on the last day of the measurement. If the
/// model does not have this day, the day of its identification is used.
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

/// Adds the remarks that a user of the model must know. The verdict, which is the first statement,
/// is left out. Some remarks may already be among the notes.
void add_obstacles(const ReportSubject& subject, std::vector<std::string>& notes) {
  const auto found = obstacles_to_use(in_use(subject, ModelPurpose::Look)).statements;
  for (std::size_t i = 1; i < found.size(); ++i)
    if (std::ranges::find(notes, found[i]) == notes.end()) notes.push_back(found[i]);
}

/// The events of the model in the store, except its verdict.
std::vector<std::string> notes_of(const ReportSubject& subject) {
  std::vector<std::string> notes;
  if (const auto& verdict = subject.document.verdict) notes = verdict->notes;
  if (notes.empty() && subject.document.run) notes = subject.document.run->notes;
  for (const StoreEvent& event : subject.events) {
    switch (event.action) {
      case StoreAction::Added:
        break;
      case StoreAction::Activated:
        notes.push_back("activated by " + who_and_when(event.actor));
        break;
      case StoreAction::Forced:
        notes.push_back("activated against the verdict by " + who_and_when(event.actor));
        break;
      case StoreAction::RolledBack:
        notes.push_back("activated again by " + who_and_when(event.actor));
        break;
      case StoreAction::Drifted:
        notes.push_back("a later run found drift: " + who_and_when(event.actor));
        break;
      case StoreAction::Removed:
        notes.push_back("removed from the store by " + who_and_when(event.actor));
        break;
    }
  }
  const auto certified = obstacles_to_use(in_use(subject, ModelPurpose::Certificate));
  if (subject.forced && !certified.refusals.empty())
    notes.insert(notes.begin(), "a certificate of it was made nevertheless, forced by " +
                                    who_and_when(*subject.forced));
  for (auto& wrong : contradictory_times(subject)) notes.push_back(std::move(wrong));
  add_obstacles(subject, notes);
  add_expired_equipment(subject, notes);
  return notes;
}

bool has_drifted(const ReportSubject& subject) {
  return !subject.events.empty() && subject.events.back().action == StoreAction::Drifted;
}

/// The first items that together have at most `most` characters, but at least one item. Each item
/// counts with at least the width of the page.
std::vector<std::string> first_of(const std::vector<std::string>& items, std::size_t most) {
  constexpr std::size_t kLine = 100;
  std::vector<std::string> first;
  std::size_t used = 0;
  for (const std::string& item : items) {
    used += std::max(item.size(), kLine);
    if (used > most && !first.empty()) break;
    first.push_back(item);
  }
  return first;
}

void add_items(HtmlReport& page, const VerdictInWords& verdict) {
  if (!verdict.reasons.empty()) {
    page.paragraph("Reasons:");
    page.list(verdict.reasons);
  }
  if (!verdict.notes.empty()) {
    page.paragraph("To know about this model:");
    page.list(verdict.notes);
  }
}

std::string_view place_in_words(const ReportSubject& subject) {
  if (!subject.entry) return "It is read from a file: whether it is active is not known.";
  return subject.entry->active ? "It is the active model." : "It is not active.";
}

}  // namespace

VerdictInWords verdict_in_words(const ReportSubject& subject) {
  VerdictInWords words{.text = {}, .reasons = {}, .notes = notes_of(subject)};
  const auto& verdict = subject.document.verdict;
  const auto set = [&](Signal signal, std::string_view text) {
    words.signal = signal;
    words.text = fmt::format("{} {}", text, place_in_words(subject));
  };

  if (!verdict) {
    set(Signal::Unlit, "No verdict: neither the model nor a store has one.");
  } else if (!verdict->accepted) {
    set(Signal::Red, verdict->forced ? "Red: the gate refused the model; it was activated by force."
                                     : "Red: the gate refused the model.");
    words.reasons = verdict->reasons;
  } else if (is_of_another_machine(in_use(subject, ModelPurpose::Look))) {
    set(Signal::Yellow, "Yellow: accepted, but made for another machine configuration.");
  } else if (has_drifted(subject)) {
    set(Signal::Yellow, "Yellow: accepted, but the machine has changed since.");
  } else {
    set(Signal::Green, "Green: the gate accepted the model.");
  }
  return words;
}

void add_verdict_of(HtmlReport& page, const ReportSubject& subject) {
  const VerdictInWords verdict = verdict_in_words(subject);
  page.heading("Verdict in full");
  page.signal(verdict.signal, verdict.text);
  add_items(page, verdict);
}

bool add_short_verdict_of(HtmlReport& page, const ReportSubject& subject) {
  constexpr std::size_t kMostOfReasons = 300, kMostOfNotes = 300;
  const VerdictInWords all = verdict_in_words(subject);
  VerdictInWords shown = all;
  shown.reasons = first_of(all.reasons, kMostOfReasons);
  shown.notes = first_of(all.notes, kMostOfNotes);
  const std::size_t more =
      all.reasons.size() - shown.reasons.size() + all.notes.size() - shown.notes.size();
  page.heading("Verdict");
  page.signal(shown.signal, shown.text);
  add_items(page, shown);
  if (more > 0)
    page.paragraph(fmt::format("{} more reasons and notes are on the next page.", more));
  return more == 0;
}

}  // namespace abbe::daemon
