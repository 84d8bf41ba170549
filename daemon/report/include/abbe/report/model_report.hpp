#pragma once
/// Reports made from stored models, the same for every method: one model, two models side by side,
/// all models of a machine. HTML without JavaScript that prints on A4. The same input gives
/// the same bytes in the same time zone; no date is contained that is not in the input.

#include <optional>
#include <string>
#include <vector>

#include "abbe/model/model_use.hpp"
#include "abbe/model/stored_model.hpp"
#include "abbe/report/certificate_details.hpp"
#include "abbe/report/certified_values.hpp"

namespace abbe::daemon {

/// A model and what the store knows of it.
struct ReportSubject {
  ModelDocument document;
  std::optional<StoreEntry> entry{};  ///< nullopt: a file, not in a store
  std::vector<StoreEvent> events{};   ///< of this model, oldest first
  CertificateDetails details{};
  std::optional<std::string> machine_hash{};  ///< ModelInUse::machine_hash
  /// Who had a certificate of the model made although it must not be used, and why.
  std::optional<StoreActor> forced{};
  /// Of the machine, when the model was identified; empty: the store is not in a data folder of
  /// abbed.
  std::string machine_id{};
  std::string identity_doubt{};  ///< ModelInUse::identity_doubt
};
[[nodiscard]] ModelInUse in_use(const ReportSubject& subject, ModelPurpose purpose);

/// A model of the store with its verdict and its events.
[[nodiscard]] Result<ReportSubject> report_subject(const ModelStore& store, const std::string& id);

/// The report of every method, from what the store has. DataInsufficient if the model has no
/// validity volume.
[[nodiscard]] Result<std::string> model_report(const ReportSubject& subject);

/// Two models side by side. DataInsufficient if they are not valid for a common tool and volume.
[[nodiscard]] Result<std::string> comparison_report(const ReportSubject& a, const ReportSubject& b);

/// Trend over models of one machine, in the order of the dates of their measurement; where that is
/// not recorded, of the identification.
[[nodiscard]] Result<std::string> trend_report(const std::vector<ReportSubject>& models);

}  // namespace abbe::daemon
