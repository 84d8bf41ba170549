#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

Result<ReportSubject> report_subject(const ModelStore& store, const std::string& id) {
  auto document = store.load(id);
  if (!document) return tl::make_unexpected(document.error());
  const auto entries = store.list();
  if (!entries) return tl::make_unexpected(entries.error());
  const auto history = store.history();
  if (!history) return tl::make_unexpected(history.error());

  ReportSubject subject{.document = *std::move(document)};
  for (const StoreEntry& entry : *entries)
    if (entry.id == id) subject.entry = entry;
  for (const StoreEvent& event : *history)
    if (event.id == id) subject.events.push_back(event);
  return subject;
}

}  // namespace abbe::daemon
