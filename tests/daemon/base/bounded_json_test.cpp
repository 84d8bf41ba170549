#include "abbe/base/bounded_json.hpp"

#include <gtest/gtest.h>

#include <string>

namespace abbe::daemon {
namespace {

std::string nested(std::size_t depth) {
  return std::string(depth, '[') + std::string(depth, ']');
}

std::string refusal_of(std::string_view text, const JsonBounds& bounds = {}) {
  const auto parsed = parse_json(text, "state.json", bounds);
  return parsed ? "" : parsed.error().text;
}

TEST(BoundedJson, ParsesWhatIsWithinTheBounds) {
  const auto parsed = parse_json(R"({"a": [1, 2.5, "]]]]{{\"[["], "b": {"c": null}})", "text");
  ASSERT_TRUE(parsed) << parsed.error().text;
  EXPECT_EQ((*parsed)["a"][2], "]]]]{{\"[[");
}

TEST(BoundedJson, RefusesDepthBeforeParsing) {
  EXPECT_TRUE(parse_json(nested(32), "text"));
  EXPECT_EQ(refusal_of(nested(33)), "state.json: nested deeper than 32 at byte 33");
  EXPECT_NE(refusal_of(std::string(140'000, '[')), "");
  std::string objects;
  for (int i = 0; i < 100'000; ++i) objects += R"({"a":)";
  EXPECT_NE(refusal_of(objects), "");
}

TEST(BoundedJson, BracketsInsideStringsDoNotCountAsDepth) {
  EXPECT_EQ(refusal_of('"' + std::string(1000, '[') + '"'), "");
  EXPECT_EQ(refusal_of("[\"\\\"" + std::string(1000, '{') + "\"]"), "");
  EXPECT_NE(refusal_of("[\"\\\\\"," + nested(40) + "]"),
            "");  // an escaped backslash: the quote ends the string
}

TEST(BoundedJson, RefusesBytesAndValuesBeforeParsing) {
  EXPECT_EQ(refusal_of("[1, 2]", {.bytes = 5}), "state.json: 6 bytes, at most 5 are read");
  EXPECT_EQ(refusal_of("[1, 2, 3]", {.values = 3}), "state.json: more than 3 values");
  EXPECT_EQ(refusal_of("[1, 2]", {.values = 3}), "");
}

TEST(BoundedJson, ASyntaxErrorNamesTheByte) {
  EXPECT_NE(refusal_of("{\"a\": tru}").find("state.json: not JSON at byte 10: "), std::string::npos)
      << refusal_of("{\"a\": tru}");
  EXPECT_NE(refusal_of("[1e999]"), "");
  EXPECT_NE(refusal_of("\"\xff\""), "");
  EXPECT_NE(refusal_of(""), "");
}

TEST(BoundedJson, ASyntaxErrorNamesLineColumnAndWhatWasExpected) {
  const std::string refusal = refusal_of("{\n \"a\" 1}");
  EXPECT_NE(refusal.find("line 2, column 6: syntax error"), std::string::npos) << refusal;
  EXPECT_NE(refusal.find("expected ':'"), std::string::npos) << refusal;
}

TEST(BoundedJson, NoRefusalNamesAnExceptionOfTheLibrary) {
  for (const auto& text : {"{\"a\": tru}", "[1e999]", ""})
    EXPECT_EQ(refusal_of(text).find("json.exception"), std::string::npos) << refusal_of(text);
  std::string cause;
  try {
    (void)nlohmann::json::object().at("events");
  } catch (const nlohmann::json::exception& missing) {
    cause = cause_of(missing);
  }
  EXPECT_EQ(cause, "key 'events' not found");
}

}  // namespace
}  // namespace abbe::daemon
