// The page of a class's door: who has the code joins; who has the teacher's address has the board.

import { takeToken, token } from "./access";
import { openBoard } from "./class_board";
import { openJoin } from "./class_join";
import { find } from "./dom";
import { dressTheme } from "./theme";
import { language } from "./words/language";

function open(): void {
  const room = find("class");
  if (token()) openBoard(room, token());
  else openJoin(room);
}

dressTheme(); // as the learner's page was left
document.documentElement.lang = language;
takeToken();
open();
window.addEventListener("hashchange", () => takeToken() && location.reload());
