#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "abbe/protocol/ippdme/lines.hpp"

namespace abbe::protocol::ippdme {
namespace {

using Kind = Response::Kind;

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span{text});
}

/// The transactions printed in I++ DME 1.4.3 as an example.
TEST(IppDmeResponse, ReadsTheExampleOfTheSpecification) {
  const auto ack = parse_response("00015 &");
  ASSERT_TRUE(ack);
  EXPECT_EQ(ack->kind, Kind::Ack);
  EXPECT_EQ(ack->tag, (Tag{false, 15}));
  const auto data = parse_response("00015 # X(199.998),Y(250.123),Z(300.002)");
  ASSERT_TRUE(data);
  EXPECT_EQ(data->kind, Kind::Data);
  const auto point = parse_point(data->data);
  ASSERT_TRUE(point);
  EXPECT_EQ(point->known, 0b111);
  EXPECT_EQ(point->p_mm, (std::array{199.998, 250.123, 300.002}));
  EXPECT_EQ(parse_response("00015 %")->kind, Kind::Complete);
}

TEST(IppDmeResponse, ReadsErrors) {
  const auto r = parse_response("00042 ! Error(2,1006,PtMeas,\"Surface not found\")");
  ASSERT_TRUE(r);
  EXPECT_EQ(r->kind, Kind::Error);
  EXPECT_EQ(r->error.severity, 2);
  EXPECT_EQ(r->error.code, 1006);
  EXPECT_EQ(r->error.origin, "PtMeas");
  EXPECT_EQ(r->error.text, "Surface not found");
}

TEST(IppDmeResponse, RecognizesUnsolicitedResponses) {
  EXPECT_EQ(parse_response("E0000 # PtMeas(X(1),Y(2),Z(3))")->tag, kUnsolicited);
}

TEST(IppDmeResponse, RefusesTextOutsideTheGrammar) {
  EXPECT_EQ(parse_response("0001 &").error(), LineError::BadTag);
  EXPECT_EQ(parse_response("00000 &").error(), LineError::BadTag);
  EXPECT_EQ(parse_response("00001&").error(), LineError::NoSpace);
  EXPECT_EQ(parse_response("00001 ?").error(), LineError::BadMarker);
  EXPECT_EQ(parse_response("00001 #X(1)").error(), LineError::BadMarker);
  EXPECT_EQ(parse_response("00001 % more").error(), LineError::BadMarker);
  EXPECT_EQ(parse_response("00001 ! Error(2,1006,PtMeas)").error(), LineError::BadError);
  EXPECT_EQ(parse_response("00001 ! Error(2.5,1006,PtMeas,\"\")").error(), LineError::BadError);
  EXPECT_EQ(parse_response("").error(), LineError::BadTag);
}

TEST(IppDmeCommand, ReadsMethodAndArguments) {
  const auto c = parse_command("E0007 PtMeas(X(1), Y(-2.5e1),IJK(0,0,1))");
  ASSERT_TRUE(c);
  EXPECT_EQ(c->tag, (Tag{true, 7}));
  EXPECT_EQ(c->method, "PtMeas");
  const auto point = parse_point(c->arguments);
  ASSERT_TRUE(point);
  EXPECT_EQ(point->known, 0b011);
  EXPECT_EQ(point->p_mm[1], -25.0);
  EXPECT_TRUE(point->has_ijk);
}

TEST(IppDmeCommand, ReadsEveryKindOfArgument) {
  const auto c = parse_command("00001 SetProp(Tool.PtMeasPar.Speed(10),\"a, (b)\",-.5,Name)");
  ASSERT_TRUE(c);
  ArgumentReader reader{c->arguments};
  std::vector<Argument> arguments;
  while (const auto a = reader.next()) arguments.push_back(a->value());
  ASSERT_EQ(arguments.size(), 4u);
  EXPECT_EQ(arguments[0].text, "Tool.PtMeasPar.Speed");
  EXPECT_EQ(arguments[0].numbers[0], 10.0);
  EXPECT_EQ(arguments[1].kind, Argument::Kind::String);
  EXPECT_EQ(arguments[1].text, "a, (b)");
  EXPECT_EQ(arguments[2].numbers[0], -0.5);
  EXPECT_EQ(arguments[3].kind, Argument::Kind::Name);
}

TEST(IppDmeCommand, RefusesTextOutsideTheGrammar) {
  EXPECT_EQ(parse_command("00001 Home").error(), LineError::BadMethod);
  EXPECT_EQ(parse_command("00001 Home() now").error(), LineError::BadMethod);
  EXPECT_EQ(parse_command("00001 X(1").error(), LineError::BadMethod);
  EXPECT_EQ(parse_command("00001 A(1,)").error(), LineError::BadArgument);
  EXPECT_EQ(parse_command("00001 A(1 2)").error(), LineError::BadArgument);
  EXPECT_FALSE(parse_command("00001 A(X(1.))"));
  EXPECT_FALSE(parse_command("00001 A(X(1e9999))"));
  EXPECT_FALSE(parse_command("00001 A(X(12345678901234567))"));
}

TEST(IppDmeText, WritesNumbersThatReadBackTheSame) {
  for (const double value : {0.0, -0.001, 199.998, 1e-9, 123456.789012345, -987654.5}) {
    const std::string line = "00001 A(X(" + number_text(value).value() + "))";
    const auto c = parse_command(line);
    ASSERT_TRUE(c) << line;
    EXPECT_NEAR(parse_point(c->arguments)->p_mm[0], value, 0.5e-9);
  }
  EXPECT_EQ(number_text(1.5), "1.5");
  EXPECT_EQ(to_string(Tag{false, 15}), "00015");
  EXPECT_EQ(to_string(Tag{true, 7}), "E0007");
}

TEST(IppDmeText, WritesNoOtherNumberForOneThatCannotBeWritten) {
  for (const double value : {std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity(), 1e15, -1e16})
    EXPECT_FALSE(number_text(value)) << value;
  EXPECT_TRUE(number_text(0.999e15));
}

TEST(IppDmeLineFramer, GivesLinesHoweverTheyAreCut) {
  const auto framer = std::make_unique<LineFramer>();
  std::vector<std::string> lines;
  for (const char c : std::string_view{"00001 &\r\n00001 # X(1)\r\n00001 %\r\n"}) {
    EXPECT_EQ(framer->push(bytes_of({&c, 1})), 1u);
    while (const auto line = framer->next()) lines.emplace_back(line->value());
  }
  EXPECT_EQ(lines, (std::vector<std::string>{"00001 &", "00001 # X(1)", "00001 %"}));
}

TEST(IppDmeLineFramer, StopsAtBytesThatAreNotText) {
  for (const std::string_view bad : {"00001 \x01", "00001 &\n", "00001 &\r0", "\xff"}) {
    const auto framer = std::make_unique<LineFramer>();
    framer->push(bytes_of(bad));
    const auto line = framer->next();
    ASSERT_TRUE(line && !*line);
    EXPECT_EQ(line->error(), LineError::IllegalCharacter);
    framer->push(bytes_of("00001 &\r\n"));
    EXPECT_FALSE(framer->next());
    framer->reset();
    framer->push(bytes_of("00001 &\r\n"));
    EXPECT_TRUE(framer->next());
  }
}

TEST(IppDmeLineFramer, TakesAnyCharacterSetBetweenQuotes) {
  const auto framer = std::make_unique<LineFramer>();
  const std::string line = "E0000 ! Error(2,1001,Machine,\"Ber\xFChrung \xC3\xA4 \t\")";
  framer->push(bytes_of(line + "\r\n00001 \xFC\r\n"));
  const auto text = framer->next();
  ASSERT_TRUE(text && *text);
  EXPECT_EQ(parse_response(**text)->error.text, "Ber\xFChrung \xC3\xA4 \t");
  const auto outside = framer->next();
  ASSERT_TRUE(outside && !*outside);
  EXPECT_EQ(outside->error(), LineError::IllegalCharacter);
}

TEST(IppDmeLineFramer, ResumesBehindTheNextEndOfALine) {
  const auto framer = std::make_unique<LineFramer>();
  framer->push(bytes_of("00001 \x01"));
  ASSERT_FALSE(framer->next()->has_value());
  framer->resume();
  framer->push(bytes_of("rest of it \"\r"));
  EXPECT_FALSE(framer->next());
  framer->push(bytes_of("\nE0002 %\r\n"));
  EXPECT_EQ(framer->next()->value(), "E0002 %");
}

TEST(IppDmeLineFramer, RefusesALineWithoutEnd) {
  const auto framer = std::make_unique<LineFramer>();
  const std::string most(kMaxLine, 'x');
  framer->push(bytes_of(most));
  EXPECT_FALSE(framer->next());
  framer->push(bytes_of("y"));
  const auto line = framer->next();
  ASSERT_TRUE(line && !*line);
  EXPECT_EQ(line->error(), LineError::TooLong);
}

}  // namespace
}  // namespace abbe::protocol::ippdme
