#include "certificate_parts.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "abbe/report/model_words.hpp"
#include "report_sections.hpp"
#include "stated_conditions.hpp"

namespace abbe::daemon {
namespace {

void write_contents(XmlText& out, std::string_view element, const std::vector<std::string>& texts) {
  out.open(element);
  for (const std::string& text : texts) out.element("dcc:content", text);
  out.close();
}

/// Writes an si:real; without uncertainty if `U` is empty.
void write_real(XmlText& out, std::string_view label, std::string_view value, std::string_view unit,
                std::string_view U) {
  out.open("si:real");
  out.element_if("si:label", label);
  out.element("si:value", value);
  out.element("si:unit", unit);
  if (!U.empty()) {
    out.open("si:expandedUnc");
    out.element("si:uncertainty", U);
    out.element("si:coverageFactor", "2");
    out.element("si:coverageProbability", "0.95");
    out.element("si:distribution", "normal");
    out.close();
  }
  out.close();
}

void write_quantity(XmlText& out, const CertifiedValue& value) {
  out.open("dcc:quantity");
  write_name(out, value.name);
  if (value.value.empty())
    write_contents(out, "dcc:noQuantity", {"not estimable: " + value.why});
  else
    write_real(out, value.key, value.value, value.is_angle ? "\\micro\\radian" : "\\micro\\metre",
               value.U);
  out.close();
}

void write_values(XmlText& out, const CertifiedValues& values) {
  out.open("dcc:results");
  for (const ValueGroup& group : values.groups) {
    out.open("dcc:result");
    write_name(out, group.name);
    write_contents(out, "dcc:description", {group.explanation, box_in_words(values.standard)});
    out.open("dcc:data");
    out.open("dcc:list");
    for (const CertifiedValue& value : group.values) write_quantity(out, value);
    out.close();
    out.close();
    out.close();
  }
  out.close();
}

/// Writes `name`, `description` and the status of a condition. The caller closes the element after
/// its data.
void open_condition(XmlText& out, std::string_view name, std::string_view description,
                    State state) {
  out.open("dcc:influenceCondition");
  write_name(out, name);
  if (!description.empty()) write_contents(out, "dcc:description", {std::string(description)});
  out.element("dcc:status", state == State::AsFound ? "beforeAdjustment" : "afterAdjustment");
  out.open("dcc:data");
}

void write_condition(XmlText& out, const StatedCondition& condition, State state) {
  if (condition.numbers.empty()) return;
  open_condition(out, condition.name, condition.origin, state);
  for (const StatedCondition::Number& number : condition.numbers) {
    out.open("dcc:quantity");
    write_real(out, number.label, number.value, condition.dsi_unit, number.U);
    out.close();
  }
  out.close();
  out.close();
}

void write_state(XmlText& out, const ReportSubject& subject, State state) {
  open_condition(out, "State of the machine", "", state);
  write_contents(out, "dcc:text",
                 {fmt::format("{} (UTC), tool offsets {}", when_in_words(subject.document),
                              tools_in_words(subject.document.model))});
  out.close();
  out.close();
}

/// Writes the conditions. The details state only those of the measurement as found.
void write_conditions(XmlText& out, const ReportSubject& subject, State state,
                      const CertificateDetails& details) {
  out.open("dcc:influenceConditions");
  write_state(out, subject, state);
  for (const StatedCondition& condition : stated_conditions(
           subject.document, state == State::AsFound ? details : CertificateDetails{}))
    write_condition(out, condition, state);
  out.close();
}

/// The certificate of an instrument: "certificate D-K-1, valid until 2027-03-31".
std::string calibration_of(const EquipmentDetails& e) {
  std::string text = xml_text(e.certificate).empty() ? "" : "certificate " + e.certificate;
  if (!e.valid_until.empty())
    text += fmt::format("{}valid until {}", text.empty() ? "" : ", ", e.valid_until);
  return text;
}

void write_equipment(XmlText& out, const std::vector<EquipmentDetails>& all, State state) {
  const auto use = state == State::AsFound ? EquipmentUse::AsFound : EquipmentUse::AsLeft;
  const auto of_state = [use](const EquipmentDetails& e) { return is_used(e, use); };
  if (std::ranges::none_of(all, of_state)) return;
  out.open("dcc:measuringEquipments");
  for (const EquipmentDetails& e : all) {
    if (!of_state(e)) continue;
    out.open("dcc:measuringEquipment");
    write_name(out, e.name);
    if (const std::string calibration = calibration_of(e); !xml_text(calibration).empty())
      write_contents(out, "dcc:description", {calibration});
    if (!xml_text(e.manufacturer).empty()) {
      out.open("dcc:manufacturer");
      write_name(out, e.manufacturer);
      out.close();
    }
    out.element_if("dcc:model", e.model);
    if (!xml_text(e.serial).empty()) {
      out.open("dcc:identifications");
      write_identification(out, "manufacturer", e.serial, "serial number");
      out.close();
    }
    out.close();
  }
  out.close();
}

void write_method(XmlText& out, const ModelDocument& document) {
  out.open("dcc:usedMethods");
  out.open("dcc:usedMethod");
  write_name(out, method_in_words(document));
  write_contents(
      out, "dcc:description",
      {"Positioning (M, E, B) and diagonals are quantities as defined in ISO 230-2 and ISO "
       "230-6, computed from the identified model. The tests of these standards were not "
       "made: no target was approached repeatedly, no diagonal was driven for them."});
  out.element("dcc:norm", "ISO 230-1");
  out.close();
  out.close();
}

/// Writes verdict, model and inputs.
void write_meta_data(XmlText& out, const ReportSubject& subject) {
  const VerdictInWords verdict = verdict_in_words(subject);
  std::vector<std::string> texts{verdict.text};
  texts.insert(texts.end(), verdict.reasons.begin(), verdict.reasons.end());
  std::vector<std::string> origin{
      fmt::format("model {}, hash {}", model_id(subject.document), model_hash(subject.document))};
  for (const InputFile& input : subject.document.inputs)
    origin.push_back(fmt::format("input {}, SHA-256 {}", input.name, input.sha256));

  out.open("dcc:measurementMetaData");
  for (const auto& [name, list] :
       {std::pair{"Verdict of the gate", &texts}, std::pair{"Model and inputs", &origin}}) {
    out.open("dcc:metaData");
    write_name(out, name);
    write_contents(out, "dcc:declaration", *list);
    out.close();
  }
  out.close();
}

}  // namespace

void write_name(XmlText& out, std::string_view text) {
  out.open("dcc:name");
  out.element("dcc:content", text);
  out.close();
}

void write_identification(XmlText& out, std::string_view issuer, std::string_view value,
                          std::string_view name) {
  if (xml_text(value).empty()) return;
  out.open("dcc:identification");
  out.element("dcc:issuer", issuer);
  out.element("dcc:value", value);
  write_name(out, name);
  out.close();
}

void write_contact(XmlText& out, std::string_view element, const Contact& contact) {
  out.open(element);
  write_name(out, contact.name);
  out.element_if("dcc:eMail", contact.email);
  out.open("dcc:location");
  out.element_if("dcc:street", contact.street);
  out.element_if("dcc:postCode", contact.post_code);
  out.element_if("dcc:city", contact.city);
  out.element_if("dcc:countryCode", contact.country);
  out.close();
  out.close();
}

void write_software(XmlText& out, std::string_view release) {
  out.open("dcc:software");
  write_name(out, "abbe");
  out.element("dcc:release", xml_text(release).empty() ? std::string_view(ABBE_VERSION) : release);
  out.element("dcc:type", "application");
  out.close();
}

void write_statement(XmlText& out, std::string_view name, const std::vector<std::string>& texts) {
  out.open("dcc:statement");
  write_name(out, name);
  write_contents(out, "dcc:declaration", texts);
  out.close();
}

void write_measurement_result(XmlText& out, const ReportSubject& subject,
                              const CertifiedValues& values, State state,
                              const CertificateDetails& details) {
  out.open("dcc:measurementResult");
  write_name(out, state == State::AsFound ? "As found" : "As left");
  write_method(out, subject.document);
  out.open("dcc:usedSoftware");
  write_software(out, subject.document.software);
  out.close();
  write_equipment(out, details.equipment, state);
  write_conditions(out, subject, state, details);
  write_values(out, values);
  write_meta_data(out, subject);
  out.close();
}

}  // namespace abbe::daemon
