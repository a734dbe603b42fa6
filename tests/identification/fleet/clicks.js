// types into the search of a fleet's page and sorts its table; the title tells what was shown
const box = document.querySelector("input");
const left = table => [...document.querySelectorAll(table + " tbody tr")].filter(r => !r.hidden);
const shown = table => left(table).map(row => row.cells[1].textContent);
const type = text => { box.value = text; box.dispatchEvent(new Event("input")); };
const told = [];
type("alpha flight1"); told.push(shown("#flights"));
type("DIED"); told.push([shown("#flights").length, shown("#refused").length]);
type("");
const heads = [...document.querySelectorAll("#flights th button")];
const head = heads.find(button => button.textContent === "Flight");
head.click(); told.push(shown("#flights").slice(0, 3));
head.click(); told.push(shown("#flights").slice(0, 3));
document.title = "told " + JSON.stringify(told);
document.body.prepend(document.title);
