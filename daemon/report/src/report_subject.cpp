#include "abbe/model/machine_identity.hpp"
#include "abbe/report/model_report.hpp"

#include <utility>

namespace abbe::daemon {

ModelInUse in_use(const ReportSubject& subject, ModelPurpose purpose) {
  return {.document = subject.document,
          .events = subject.events,
          .machine_hash = subject.machine_hash,
          .purpose = purpose};
}

Result<ReportSubject> report_subject(const ModelStore& store, const std::string& id) {
  auto stored = stored_model(store, id);
  if (!stored) return tl::make_unexpected(stored.error());
  ReportSubject subject{.document = std::move(stored->document),
                        .entry = std::move(stored->entry),
                        .events = std::move(stored->events)};
  // The store of abbed is DATA_DIR/models. A report is made also where the identity cannot be read.
  const auto data_dir = store.model_path(id).parent_path().parent_path().parent_path();
  if (const auto identity = read_identity(data_dir); identity && *identity)
    subject.machine_id = (*identity)->machine_id_at(subject.document.created);
  return subject;
}

}  // namespace abbe::daemon
