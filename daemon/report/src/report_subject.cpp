#include "abbe/model/machine_identity.hpp"
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
  // The store of abbed is DATA_DIR/models. A report is made also where the identity cannot be read.
  const auto data_dir = store.model_path(id).parent_path().parent_path().parent_path();
  if (const auto identity = read_identity(data_dir); identity && *identity)
    subject.machine_id = (*identity)->machine_id_at(subject.document.created);
  return subject;
}

}  // namespace abbe::daemon
