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
  return ReportSubject{.document = std::move(stored->document),
                       .entry = std::move(stored->entry),
                       .events = std::move(stored->events)};
}

}  // namespace abbe::daemon
