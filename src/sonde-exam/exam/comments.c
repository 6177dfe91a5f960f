// Comments of a teacher: notes of the recording; RECORDING.comments.json of old ones.
#include "exam/record.h"

#include "base/bounds.h"
#include "base/utf8.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

static const double longest_s = 1e6;

static char *path_of(const char *recording) {
  size_t bytes = strlen(recording) + sizeof ".comments.json";
  char *path = SONDE_NEW(char, bytes);
  if (path) snprintf(path, bytes, "%s.comments.json", recording);
  return path;
}

// UTF-8 without control characters but line ends and tabs, terminated within `size` bytes.
static bool is_text(const char *text, size_t size) {
  const char *end = memchr(text, 0, size);
  if (!end) return false;
  for (const unsigned char *c = (const unsigned char *)text; *c;) {
    size_t bytes = utf8_character(c);
    bool control = *c == 0x7f || (*c < 0x20 && *c != '\n' && *c != '\t');
    if (bytes == 0 || control) return false;
    c += bytes;
  }
  return true;
}

// What is wrong, NULL: nothing.
static const char *fault_of(const sonde_comment *c) {
  if (!(c->time_s >= 0 && c->time_s <= longest_s)) return "has a time that is not one";
  if (!is_text(c->author, sizeof c->author)) return "has an author that is not text of 63 bytes";
  if (!is_text(c->text, sizeof c->text)) return "has a text that is not UTF-8 of 1023 bytes";
  return c->text[0] ? NULL : "has no text";
}

static void copy_text(const sonde_json *object, const char *key, char *to, size_t size) {
  const char *text = sonde_json_as_text(sonde_json_member(object, key));
  if (text && strlen(text) < size)
    snprintf(to, size, "%s", text);
  else
    memset(to, 0xff, size); // no text: fault_of() says so
}

static void read_comment(const sonde_json *object, sonde_comment *comment) {
  comment->time_s = sonde_json_as_number(sonde_json_member(object, "time_s"));
  copy_text(object, "author", comment->author, sizeof comment->author);
  copy_text(object, "text", comment->text, sizeof comment->text);
}

// Behind those of the same time.
static void insert(sonde_comments *comments, const sonde_comment *comment) {
  uint32_t at = comments->count;
  for (; at > 0 && comments->list[at - 1].time_s > comment->time_s; --at)
    comments->list[at] = comments->list[at - 1];
  comments->list[at] = *comment;
  comments->count++;
}

// Those of a file from before version 8.
static sonde_status load_file(const char *recording, sonde_comments *comments, sonde_error *error) {
  char *path = path_of(recording), *bytes = NULL;
  size_t size = 0;
  sonde_json *root = NULL;
  sonde_status status = path ? SONDE_OK : sonde_fail_memory(error);
  if (status || access(path, F_OK) != 0) goto done;
  status = sonde_bounded_load_text(path, &sonde_limits_json, &bytes, &size, error);
  if (!status)
    status = sonde_json_parse(bytes, size, &(sonde_json_source){.name = path}, &root, error);
  if (status) goto done;
  const sonde_json *list = sonde_json_member(root, "comments");
  if (sonde_json_kind_of(list) != SONDE_JSON_LIST || sonde_json_count(list) > SONDE_MAX_COMMENTS)
    status = sonde_fail(error, SONDE_FORMAT, "%s: expected a list \"comments\" of at most %d", path,
                        SONDE_MAX_COMMENTS);
  const sonde_json *item = status ? NULL : sonde_json_first(list);
  for (int at = 0; item && !status; ++at, item = sonde_json_next(item)) {
    sonde_comment comment;
    read_comment(item, &comment);
    const char *fault = fault_of(&comment);
    if (fault)
      status = sonde_fail(error, SONDE_FORMAT, "%s: comment %d %s", path, at, fault);
    else
      insert(comments, &comment);
  }
done:
  sonde_json_free(root);
  sonde_free(bytes);
  sonde_free(path);
  return status;
}

sonde_status sonde_comments_load(const char *recording, sonde_comments *comments,
                                 sonde_error *error) {
  SONDE_ASSERT(recording != NULL && comments != NULL);
  *comments = (sonde_comments){.list = SONDE_NEW(sonde_comment, SONDE_MAX_COMMENTS + 1)};
  if (!comments->list) return sonde_fail_memory(error);
  sonde_notes notes = {0};
  sonde_status status = load_file(recording, comments, error);
  if (!status && access(recording, F_OK) == 0) {
    (void)sonde_notes_load(recording, &notes, NULL); // who plays the recording says what ails it
    // A note of a journal that is not a usable comment is left out: the recording is whole without
    // it.
    for (uint32_t i = 0; i < notes.count && comments->count < SONDE_MAX_COMMENTS; ++i) {
      const sonde_note *note = &notes.list[i];
      sonde_comment comment;
      sonde_json *root = NULL;
      if (note->kind != SONDE_NOTE_COMMENT) continue;
      if (sonde_json_parse(note->text, strlen(note->text), NULL, &root, NULL)) continue;
      read_comment(root, &comment);
      if (!fault_of(&comment)) insert(comments, &comment);
      sonde_json_free(root);
    }
    sonde_notes_clear(&notes);
  }
  if (status) sonde_comments_clear(comments);
  return status;
}

static void put_comment(sonde_json_out *out, const sonde_comment *comment) {
  sonde_json_begin_object(out, NULL);
  sonde_json_put_real(out, "time_s", comment->time_s, 0);
  sonde_json_put_text(out, "author", comment->author);
  sonde_json_put_text(out, "text", comment->text);
  sonde_json_end(out);
}

char *sonde_comment_json(const sonde_comment *comment, sonde_error *error) {
  const char *fault = fault_of(comment);
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  char *text = NULL;
  size_t count;
  if (fault) {
    sonde_fail(error, SONDE_ARGUMENT, "the comment %s", fault);
    return NULL;
  }
  if (sonde_file_in_memory(&out.file, error)) return NULL;
  put_comment(&out, comment);
  (void)sonde_file_take(out.file, &text, &count, error);
  return text;
}

sonde_status sonde_comments_add(const char *recording, const sonde_comment *comment,
                                sonde_error *error) {
  SONDE_ASSERT(recording != NULL && comment != NULL);
  sonde_comments comments = {0};
  sonde_error own = {0};
  char *text = sonde_comment_json(comment, &own);
  sonde_status status = text ? sonde_comments_load(recording, &comments, &own) : own.status;
  if (!status && comments.count >= SONDE_MAX_COMMENTS)
    status = sonde_fail(&own, SONDE_ARGUMENT, "%s has %d comments already", recording,
                        SONDE_MAX_COMMENTS);
  // A journal takes the comment as a note; an older recording gets a file of comments beside it.
  if (!status) {
    status = sonde_notes_add(recording, SONDE_NOTE_COMMENT, text, &own);
    if (status == SONDE_VERSION) {
      insert(&comments, comment);
      char *path = path_of(recording);
      sonde_json_out out = {.layout = SONDE_JSON_TABS};
      status = path ? sonde_file_create(path, &out.file, &own) : sonde_fail_memory(&own);
      if (!status) {
        sonde_json_begin_object(&out, NULL);
        sonde_json_begin_list(&out, "comments");
        for (uint32_t k = 0; k < comments.count; ++k) put_comment(&out, &comments.list[k]);
        sonde_json_end(&out);
        sonde_json_end(&out);
        sonde_file_printf(out.file, "\n");
        status = sonde_file_commit(out.file, &own);
      }
      sonde_free(path);
    }
  }
  if (status && error) *error = own;
  sonde_comments_clear(&comments);
  sonde_free(text);
  return status;
}

void sonde_comments_clear(sonde_comments *comments) {
  sonde_free(comments->list);
  *comments = (sonde_comments){0};
}
