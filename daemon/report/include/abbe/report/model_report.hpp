#pragma once
/// Reports made from stored models, the same for every method: one model, two models side by side,
/// all models of a machine. The HTML has no JavaScript and prints on A4. The same input in the same
/// time zone gives the same bytes; the report contains only dates of the input.

#include <optional>
#include <string>
#include <vector>

#include "abbe/model/model_use.hpp"
#include "abbe/model/stored_model.hpp"
#include "abbe/report/certificate_details.hpp"
#include "abbe/report/certified_values.hpp"

namespace abbe::daemon {

/// A model, with the information that the store has of it.
struct ReportSubject {
  ModelDocument document;
  std::optional<StoreEntry> entry{};  ///< nullopt: the model is in a file and not in a store
  std::vector<StoreEvent> events{};   ///< events of this model, oldest first
  CertificateDetails details{};
  std::optional<std::string> machine_hash{};  ///< see ModelInUse::machine_hash
  /// Set if a certificate of the model was made although the model must not be used: who had it
  /// made, and why.
  std::optional<StoreActor> forced{};
  /// The identity of the machine when the model was identified; empty: the store is not in a data
  /// folder of abbed.
  std::string machine_id{};
  std::string identity_doubt{};  ///< see ModelInUse::identity_doubt
};
[[nodiscard]] ModelInUse in_use(const ReportSubject& subject, ModelPurpose purpose);

/// Reads a model of the store with its verdict and its events.
[[nodiscard]] Result<ReportSubject> report_subject(const ModelStore& store, const std::string& id);

/// The report of one model, the same for every method. DataInsufficient if the model has no
/// validity volume.
[[nodiscard]] Result<std::string> model_report(const ReportSubject& subject);

/// The comparison of two models. DataInsufficient if they are not valid for a common tool and
/// volume.
[[nodiscard]] Result<std::string> comparison_report(const ReportSubject& a, const ReportSubject& b);

/// The trend over the models of one machine, ordered by the date of their measurement, or by that
/// of their identification where the first is not recorded.
[[nodiscard]] Result<std::string> trend_report(const std::vector<ReportSubject>& models);

}  // namespace abbe::daemon
