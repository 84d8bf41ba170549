#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

// ModelStore::list() would read every model of the store.
Result<ReportSubject> report_subject(const ModelStore& store, const std::string& id) {
  auto document = store.load(id);
  if (!document) return tl::make_unexpected(document.error());
  const auto active = store.active_id();
  if (!active) return tl::make_unexpected(active.error());
  const auto history = store.history();
  if (!history) return tl::make_unexpected(history.error());

  ReportSubject subject{.document = *std::move(document)};
  for (const StoreEvent& event : *history) {
    if (event.id != id) continue;
    subject.events.push_back(event);
    if (event.action == StoreAction::Added)
      subject.entry = StoreEntry{.id = id,
                                 .active = *active == id,
                                 .accepted = event.accepted,
                                 .reasons = event.reasons,
                                 .added = event.actor.when,
                                 .method = subject.document.method,
                                 .machine = subject.document.machine};
  }
  return subject;
}

}  // namespace abbe::daemon
