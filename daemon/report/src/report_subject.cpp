#include "abbe/model/machine_identity.hpp"
#include "abbe/report/model_report.hpp"
#include "abbe/result/try.hpp"

#include <utility>

namespace abbe::daemon {

ModelInUse in_use(const ReportSubject& subject, ModelPurpose purpose) {
  return {.document = subject.document,
          .events = subject.events,
          .machine_hash = subject.machine_hash,
          .purpose = purpose,
          .identity_doubt = subject.identity_doubt};
}

Result<ReportSubject> report_subject(const ModelStore& store, const std::string& id) {
  auto stored = stored_model(store, id);
  ABBE_TRY(stored);
  ReportSubject subject{.document = std::move(stored->document),
                        .entry = std::move(stored->entry),
                        .events = std::move(stored->events)};
  // The report is also made if the identity cannot be read.
  subject.identity_doubt = identity_doubt(store, id, marks_of_this_computer());
  const auto identity = identity_of(store);
  if (!identity || !*identity) return subject;
  const auto history = store.history();
  auto known = history ? machine_id_of_model(**identity, *history, id) : std::nullopt;
  subject.machine_id = known ? *known : (*identity)->machine_id_at(subject.document.created);
  return subject;
}

}  // namespace abbe::daemon
